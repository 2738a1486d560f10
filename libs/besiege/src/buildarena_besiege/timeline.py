"""A control sequence as a timeline of channels, `buildarena.control_timeline.v2`."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, Final

from buildarena_besiege.errors import MachineNotPlayableError
from buildarena_besiege.names import key_entries

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from buildarena_geometry import Machine

SCHEMA: Final = "buildarena.control_timeline.v2"

_CHANNELS: Final = {
    "bmt-forward": "ForwardKey",
    "bmt-backward": "BackwardKey",
    "bmt-shoot": "ShootKey",
    "bmt-thrust": "ThrustKey",
    "bmt-left": "leftKey",
    "bmt-right": "rightKey",
    "bmt-explode": "ExplodeKey",
    "bmt-contract": "ContractKey",
    "bmt-spin": "FlyKey",
    "bmt-extend": "ExtendKey",
    "bmt-ignite": "IgniteKey",
    "bmt-attach": "attachKey",
    "bmt-detach": "detachKey",
    "bmt-detonate": "DetonateKey",
    "bmt-launch": "LaunchKey",
    "bmt-fire": "FireKey",
    "bmt-vacuum": "VacuumKey",
    "bmt-main": "MainKey",
    "bmt-secondary": "SecondaryKey",
    "bmt-activate": "ActivateKey",
    "bmt-raise-sail": "RaiseSail",
    "bmt-lower-sail": "LowerSail",
    "bmt-increase-buoyancy": "increaseBuoyancy",
    "bmt-decrease-buoyancy": "decreaseBuoyancy",
    "bmt-retract": "RetractKey",
    "bmt-link": "LinkKey",
    "bmt-deploy": "deployKey",
}
_OF_TYPE: Final = {
    (91, "bmt-left"): "LeftKey",
    (91, "bmt-right"): "RightKey",
    (98, "bmt-detach"): "DetachKey",
    (101, "bmt-left"): "LeftKey",
    (101, "bmt-right"): "RightKey",
}
"""Channels that a type spells in another way."""


def control_timeline(
    machine: Machine,
    key_changes: Sequence[tuple[float, str, bool]],
    bindings: Mapping[str, Mapping[str, Sequence[str]]],
    numbers: Mapping[str, int],
) -> dict[str, Any]:
    """The timeline that does what a run's keys do.

    An action is on while any of its keys is down.

    Args:
        machine: The machine.
        key_changes: Time in seconds, key, whether it goes down; in order of time.
        bindings: The keys of each block's actions, by block id.
        numbers: Which block of the machine's file each block is, from 1.

    Raises:
        MachineNotPlayableError: A key moves an action that no channel is known of.
    """
    events: list[dict[str, Any]] = []
    down: set[str] = set()
    active: set[tuple[str, str]] = set()
    pressed = {key for _, key, _ in key_changes}
    bound = [
        (block_id, action, frozenset(keys))
        for block_id, actions in bindings.items()
        for action, keys in actions.items()
        if pressed.intersection(keys)
    ]
    for index, (time_s, key, goes_down) in enumerate(key_changes):
        (down.add if goes_down else down.discard)(key)
        if index + 1 < len(key_changes) and key_changes[index + 1][0] == time_s:
            continue
        for block_id, action, keys in bound:
            on = not keys.isdisjoint(down)
            if on == ((block_id, action) in active):
                continue
            (active.add if on else active.discard)((block_id, action))
            channel = channel_of(machine, block_id, action)
            events.append(event(time_s, numbers[block_id], channel, 1.0 if on else 0.0))
    return {"schema": SCHEMA, "events": events}


def event(time_s: float, block: int, channel: str, value: float) -> dict[str, Any]:
    """One entry of a timeline: from a time on, a channel of a block has a value, 0 to 1."""
    return {"time": time_s, "block": block, "channel": channel, "value": value}


def channel_of(machine: Machine, block_id: str, action: str) -> str:
    """The channel of a block's action.

    Raises:
        MachineNotPlayableError: None is known.
    """
    part = machine.blocks.get(block_id)
    if part is None:
        raise MachineNotPlayableError(f"no channel is known of {action} of connector {block_id}")
    module = part.module
    entry = key_entries(module).get(action, "")
    channel = _OF_TYPE.get((module.besiege_id, entry)) or _CHANNELS.get(entry)
    if channel is None:
        raise MachineNotPlayableError(
            f"no channel is known of {action} of block {block_id} ({module.name})"
        )
    return channel


def timeline_bytes(timeline: Mapping[str, Any]) -> bytes:
    """A timeline as a file."""
    return json.dumps(timeline, indent=1).encode()
