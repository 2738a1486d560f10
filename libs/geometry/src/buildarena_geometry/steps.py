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
    ids = dict.fromkeys(changed)
    blocks = [(before.blocks.get(key), after.blocks[key]) for key in ids if key in after.blocks]
    links = [] if before.connectors is after.connectors else _changed_links(before, after)
    pressed = after.control_sequence
    return Difference(
        added=(
            *(now for was, now in blocks if was is None),
            *(now for was, now in links if was is None),
        ),
        moved=(
            *(now for was, now in blocks if was and was.world_from_block != now.world_from_block),
            *(now for was, now in links if was and _place(was) != _place(now)),
        ),
        rebound=(
            *(now for was, now in blocks if was and _use(was) != _use(now)),
            *(now for was, now in links if was and was.bindings != now.bindings),
        ),
        removed=tuple(
            key for key in ids if key not in after.blocks and key not in after.connectors
        ),
        control_sequence=None if before.control_sequence == pressed else pressed,
    )


def _changed_links(
    before: MachineState, after: MachineState
) -> list[tuple[Connector | None, Connector]]:
    pairs = ((before.connectors.get(key), now) for key, now in after.connectors.items())
    return [(was, now) for was, now in pairs if was is not now]


def _place(link: Connector) -> tuple[object, ...]:
    return (link.start_xyz, link.end_xyz, link.world_from_connector)


def _use(block: Block) -> tuple[object, ...]:
    return (block.bindings, block.flipped)
