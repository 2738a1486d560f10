"""A machine's history: its actions repeated, each with its changes."""

from collections.abc import Sequence
from dataclasses import dataclass

from buildarena_geometry.blocks import Block, Connector, KeyPress
from buildarena_geometry.machine import Machine
from buildarena_geometry.outcomes import Outcome, Refused
from buildarena_geometry.state import MachineState


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """Difference of two states of a machine, with the parts of the later one.

    Attributes:
        added: new blocks, then new connectors.
        moved: parts with a new pose; a connector's end or own frame moved.
        rebound: parts whose keys or sense of rotation changed.
        removed: ids of removed blocks and connectors.
        control_sequence: the key presses, where they changed; otherwise None.
    """

    added: tuple[Block | Connector, ...] = ()
    moved: tuple[Block | Connector, ...] = ()
    rebound: tuple[Block | Connector, ...] = ()
    removed: tuple[str, ...] = ()
    control_sequence: tuple[KeyPress, ...] | None = None


def step(machine: Machine, name: object, arguments: object) -> tuple[Outcome, Difference]:
    """Execute an action on a machine; return its outcome and its changes, none if refused."""
    before = machine.state
    outcome = machine.act(name, arguments)
    if isinstance(outcome, Refused):
        return outcome, Difference()
    return outcome, _difference(before, machine.state, outcome.changed)


def _difference(before: MachineState, after: MachineState, changed: Sequence[str]) -> Difference:
    """Return the changes that an action made.

    Args:
        changed: ids that it named, without connectors that only followed blocks.
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
