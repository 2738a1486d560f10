"""How a machine came about: its actions done again, each with what it changed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from buildarena_geometry.blocks import Block, Connector, KeyPress
from buildarena_geometry.machine import Machine
from buildarena_geometry.outcomes import Outcome, Refused
from buildarena_geometry.state import MachineState


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """What makes one state of a machine another: parts as they are afterwards.

    Attributes:
        added: new blocks, then new connectors.
        moved: those in another place; of a connector an end, or its own frame.
        rebound: parts whose keys or sense of rotation changed.
        removed: ids of blocks and connectors that are gone.
        control_sequence: the key presses, where they changed; otherwise None.
    """

    added: tuple[Block | Connector, ...] = ()
    moved: tuple[Block | Connector, ...] = ()
    rebound: tuple[Block | Connector, ...] = ()
    removed: tuple[str, ...] = ()
    control_sequence: tuple[KeyPress, ...] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """One action and what came of it.

    Attributes:
        outcome: whether it was accepted, and what a model reads about it.
        difference: what it changed; nothing where it was refused.
    """

    outcome: Outcome
    difference: Difference


def step(machine: Machine, name: object, arguments: object) -> Step:
    """Carries out an action on a machine, and returns what that changed."""
    before = machine.state
    outcome = machine.act(name, arguments)
    if isinstance(outcome, Refused):
        return Step(outcome=outcome, difference=Difference())
    return Step(outcome=outcome, difference=_difference(before, machine.state, outcome.changed))


def _difference(before: MachineState, after: MachineState, changed: Sequence[str]) -> Difference:
    """What an action changed.

    Args:
        before: the state that it met.
        after: the state that it left.
        changed: ids that it named; connectors that only followed blocks are not among them.
    """
    ids, pressed = dict.fromkeys(changed), after.control_sequence
    old = {part.id: part for part in before.parts}
    new = {part.id: part for part in after.parts}
    # Connectors may have followed blocks without being named.
    touched = [key for key in ids if key in after.blocks]
    touched += [key for key, link in after.connectors.items() if link is not old.get(key)]
    pairs = [(old.get(key), new[key]) for key in touched]
    return Difference(
        added=tuple(now for was, now in pairs if was is None),
        moved=tuple(now for was, now in pairs if was and _place(was) != _place(now)),
        rebound=tuple(now for was, now in pairs if was and _use(was) != _use(now)),
        removed=tuple(key for key in ids if key not in new),
        control_sequence=None if before.control_sequence == pressed else pressed,
    )


def _place(part: Block | Connector) -> tuple[object, ...]:
    if isinstance(part, Connector):
        return (part.start_xyz, part.end_xyz, part.world_from_connector)
    return (part.world_from_block,)


def _use(part: Block | Connector) -> tuple[object, ...]:
    return (part.bindings, isinstance(part, Block) and part.flipped)
