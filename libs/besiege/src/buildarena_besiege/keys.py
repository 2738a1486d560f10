"""Edges of the holds of a control sequence: the times at which each key goes down and up."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final, TypeVar

from buildarena_besiege.errors import MachineNotPlayableError
from buildarena_geometry import KeyPress, Machine
from buildarena_geometry.keys import KEYS, KEYS_IN_WORDS
from buildarena_simulation.scenario import Control

Moment = TypeVar("Moment", int, float)

UPDATES_PER_S: Final = 100
"""Calls of the script by the game, per second of its own time."""

FIRING_KEY: Final = "Alpha1"
"""The key that fires every cannon of a trial whose cannons are held."""

_OWN_KEYS: Final = (*KEYS, *(f"Joystick{j}Button{b}" for j in range(1, 9) for b in range(20)))
"""Keys that a trial with a program presses: rarely typed ones, and more than machines have."""

_LATEST_S: Final = 1e6
"""Latest end of a hold, seconds; every trial is shorter."""


@dataclass(frozen=True, slots=True, order=True)
class Edge:
    """A change of a key.

    Attributes:
        update: update of the script in which it changes, from 1.
        down: true if it goes down.
    """

    update: int
    key: str
    down: bool


def key_edges(presses: Iterable[KeyPress]) -> tuple[Edge, ...]:
    """Return the edges of some holds, in order of time.

    Start and end of a hold are each rounded to a tenth of a second, as the published runner does.
    Holds of one key that overlap or touch are merged; those without a length are dropped.

    Args:
        presses: Holds in any order.

    Raises:
        MachineNotPlayableError: A time is not a number, or the game has no such key.
    """
    holds: dict[str, list[tuple[int, int]]] = {}
    for press in presses:
        _validate_trajectory(press)
        start = _update(press.time_s)
        end = _update(press.time_s + press.hold_for_s)
        if max(start, 1) < end:
            holds.setdefault(press.key, []).append((max(start, 1), end))
    edges = [
        edge
        for key, spans in holds.items()
        for start, end in united(spans)
        for edge in (Edge(start, key, down=True), Edge(end, key, down=False))
    ]
    return tuple(sorted(edges))


def bound_presses(presses: Sequence[KeyPress], machine: Machine) -> tuple[KeyPress, ...]:
    """Return the presses whose key is bound to some action of the machine."""
    bound = set(machine.state.keys_in_use())
    return tuple(press for press in presses if press.key in bound)


def firing_edges(machine: Machine, control: Control) -> tuple[Edge, ...]:
    """Return the edges of a trial whose cannons fire by themselves: one key, which stays down.

    From 0 s on, no key is pressed at all: only burning cannons matter then.
    """
    if control.from_s <= 0.0 or not cannons(machine):
        return ()
    return (Edge(max(_update(control.from_s), 1), FIRING_KEY, down=True),)


def bindings_of(machine: Machine, control: Control | None) -> dict[str, dict[str, tuple[str, ...]]]:
    """Return the keys of each block's actions in a trial.

    Args:
        machine: Machine with its bindings.
        control: Control of the trial; cannons that fire by themselves also have the key for that.
    """
    fired_by_us = control is not None and control.mode == "constant" and control.from_s > 0.0
    bound: dict[str, dict[str, tuple[str, ...]]] = {}
    for block in machine.blocks.values():
        bindings = {action: tuple(keys) for action, keys in block.bindings.items()}
        for keys in bindings.values():
            for key in keys:
                _require_key(key, f"Block {block.id} is bound to")
        if fired_by_us and block.module.thrust is not None:
            action = block.module.thrust.action
            bindings[action] = (*bindings.get(action, ()), FIRING_KEY)
        bound[block.id] = bindings
    return bound


def channel_keys(machine: Machine) -> dict[str, dict[str, tuple[str, ...]]]:
    """Return a separate key for each action of each block, for trials with a program.

    Raises:
        MachineNotPlayableError: There are more actions than keys.
    """
    actions = [(block.id, action) for block in machine.blocks.values() for action in block.bindings]
    if len(actions) > len(_OWN_KEYS):
        raise MachineNotPlayableError(
            f"the machine's blocks have {len(actions)} actions; in the game a program has "
            f"{len(_OWN_KEYS)} keys for them"
        )
    bound: dict[str, dict[str, tuple[str, ...]]] = {block: {} for block in machine.blocks}
    for (block_id, action), key in zip(actions, _OWN_KEYS, strict=False):
        bound[block_id][action] = (key,)
    return bound


def cannons(machine: Machine) -> tuple[str, ...]:
    """Return the ids of all cannons."""
    return tuple(block.id for block in machine.blocks.values() if block.module.thrust is not None)


def _update(time_s: float) -> int:
    """Return the first update at or after a time that is rounded to a tenth of a second."""
    tenths = float(f"{min(time_s, _LATEST_S):.1f}")
    return round(tenths * UPDATES_PER_S)


def united(spans: Iterable[tuple[Moment, Moment]]) -> list[tuple[Moment, Moment]]:
    """Return the spans of time in order, those that touch or overlap as one."""
    merged: list[tuple[Moment, Moment]] = []
    for start, end in sorted(spans):
        if merged and start <= merged[-1][1]:
            merged[-1] = (merged[-1][0], max(merged[-1][1], end))
        else:
            merged.append((start, end))
    return merged


def _validate_trajectory(press: KeyPress) -> None:
    _require_key(press.key, "The control sequence presses")
    if math.isnan(press.time_s) or math.isnan(press.hold_for_s) or press.time_s == -math.inf:
        raise MachineNotPlayableError(
            f"The control sequence holds {press.key} from {press.time_s} for {press.hold_for_s}: "
            f"times are numbers of seconds."
        )


def _require_key(key: str, owner: str) -> None:
    if key not in KEYS:
        raise MachineNotPlayableError(f"{owner} the key {key!r}; the keys are {KEYS_IN_WORDS}.")
