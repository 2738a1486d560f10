"""A machine under construction: the only dispatcher of actions, and queries."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from buildarena_geometry.actions.parameters import LARGEST_NUMBER, RefusalError, quote
from buildarena_geometry.blocks import Block, Connector, Joint, KeyPress
from buildarena_geometry.collision import CollisionWorld, Overlap, unwanted
from buildarena_geometry.documents.log import ActionRecord, LoggedState
from buildarena_geometry.documents.read import read_machine
from buildarena_geometry.documents.write import machine_document
from buildarena_geometry.feedback.joints import consequences
from buildarena_geometry.feedback.state import title
from buildarena_geometry.feedback.words import listing, number
from buildarena_geometry.json_values import MAX_CONTROLLER_BYTES, check_controller, json_value
from buildarena_geometry.modules.catalogue import load_catalogue
from buildarena_geometry.modules.module import Catalogue
from buildarena_geometry.outcomes import Accepted, Cause, Outcome, Refused
from buildarena_geometry.state import Change, MachineState
from buildarena_geometry.tools import BATCH, find_action, is_batch, read_batch, tool_definitions

_DIGITS = 1e-6  # hundredths that a depth may be above a round figure and not be rounded up
_OFFERED = tuple(tool.name for tool in tool_definitions() if tool is not BATCH)


class Machine:
    """A machine that is built action by action.

    Every action goes through `act`, which checks it, carries it out or refuses it, and remembers
    it. Whatever arrives, `act` returns an outcome and the machine stays sound: no two blocks
    overlap, each block sits on at most one face, and a refused action leaves everything as it was.

    World frame: x east, y north, z up; lengths in units (edge of a small block), masses in mass
    units.
    """

    __slots__ = ("_available", "_records", "_state", "_world")

    def __init__(
        self, *, catalogue: Catalogue | None = None, available: Mapping[str, Machine] | None = None
    ) -> None:
        """Create an empty machine.

        Args:
            catalogue: modules that it may use. Defaults to the basic ones.
            available: finished machines by name. With some, this machine is an assembly: it begins
                with `add_machine` instead of `start`. They are taken as they are now.
        """
        self._available = {name: machine.log for name, machine in (available or {}).items()}
        self._state = MachineState(
            catalogue=load_catalogue() if catalogue is None else catalogue,
            available={name: logged.state for name, logged in self._available.items()},
        )
        self._records: list[ActionRecord] = []
        self._world: CollisionWorld | None = CollisionWorld()

    def act(self, name: object, arguments: object = None) -> Outcome:
        """Execute one action, or refuse it.

        Args:
            name: an action's name; `tool_definitions` lists them.
            arguments: its arguments, JSON values by name.

        Returns:
            `Accepted` or `Refused`; no input raises.
        """
        try:
            if is_batch(name):
                return self._build(read_batch(arguments))
            outcome: Outcome = self._carry_out(self._propose(name, arguments))
        except RefusalError as refusal:
            outcome = refusal.outcome
        self._record(name, arguments, outcome)
        return outcome

    @classmethod
    def restored(cls, logged: LoggedState) -> Self:
        """Create the machine of a valid state and log, without checks."""
        machine = object.__new__(cls)
        machine._available = dict(logged.available)
        machine._state = logged.state
        machine._records = list(logged.records)
        machine._world = None  # built from the state at the first action that needs it
        return machine

    def copy(self) -> Self:
        """Return an independent machine equal to this one, with its log."""
        return self.restored(self.log)

    def return_to(self, logged: LoggedState) -> None:
        """Return this machine to one of its earlier states.

        The cost is proportional to the difference; `restored` rebuilds the whole machine.

        Args:
            logged: earlier value of `log` of this machine or of a copy of it.

        Raises:
            ValueError: the value is another assembly's.
        """
        if logged.state.available is not self._state.available:
            raise ValueError(
                "cannot restore: other sub-structures were available when it was saved"
            )
        if self._world is not None:
            self._world.become(self._state.blocks, logged.state.blocks)
        self._state = logged.state
        self._records = list(logged.records)

    def __eq__(self, other: object) -> bool:
        """Compare the machines, not their histories."""
        if not isinstance(other, Machine):
            return NotImplemented
        return _compared(self._state) == _compared(other._state)

    __hash__ = None  # type: ignore[assignment]  # it changes

    def __repr__(self) -> str:
        return f"Machine({len(self.blocks)} blocks, {len(self.connectors)} connectors)"

    @property
    def state(self) -> MachineState:
        """Everything it is at this moment, as a value."""
        return self._state

    @property
    def log(self) -> LoggedState:
        """Everything it is, and every action so far, accepted and refused, as a value."""
        records = tuple(self._records)
        return LoggedState(state=self._state, records=records, available=self._available)

    @property
    def started(self) -> bool:
        """True if it has a starting block."""
        return self._state.started

    @property
    def catalogue(self) -> Catalogue:
        """The modules it may be made of."""
        return self._state.catalogue

    @property
    def available(self) -> Mapping[str, Machine]:
        """Copies of the machines an assembly may be made of, by name."""
        return {name: self.restored(logged) for name, logged in self._available.items()}

    @property
    def blocks(self) -> Mapping[str, Block]:
        """Its blocks by id, in the order of creation; connectors are not among them."""
        return MappingProxyType(self._state.blocks)

    @property
    def connectors(self) -> Mapping[str, Connector]:
        """Its braces and winches by id, in the order of creation."""
        return MappingProxyType(self._state.connectors)

    @property
    def joints(self) -> tuple[Joint, ...]:
        """Attachment of each block to the face it sits on, in the order of the blocks."""
        return tuple(self._state.joints())

    @property
    def control_sequence(self) -> tuple[KeyPress, ...]:
        """The key presses in the order of entry."""
        return self._state.control_sequence

    @property
    def controller(self) -> str:
        """The program that acts in place of the control sequence; "" without one."""
        return self._state.controller

    def with_controller(self, program: str) -> Self:
        """Return a copy that a program controls.

        Args:
            program: Lua, see docs/control.md; "" keeps the control sequence. It is not parsed here.

        Raises:
            ValueError: It is too long or cannot be stored.
        """
        check_controller(program)
        state = replace(self._state, controller=program)
        return self.restored(replace(self.log, state=state))

    @property
    def mass(self) -> float:
        """Mass of all blocks and connectors, mass units."""
        return self._state.mass

    @property
    def cost(self) -> int:
        """Besiege's price of all blocks and connectors."""
        return self._state.cost

    @property
    def part_count(self) -> int:
        """Number of blocks and connectors, the starting block included."""
        return len(self._state.blocks) + len(self._state.connectors)

    @property
    def center_of_mass(self) -> NDArray[np.float64]:
        """(3,) world frame, units; blocks count at their centers, connectors at their middles.

        Raises:
            ValueError: the machine is empty.
        """
        return self._state.center_of_mass

    @property
    def bounds(self) -> NDArray[np.float64]:
        """(2, 3) smallest and largest coordinates of the blocks' bodies, world frame, units.

        Raises:
            ValueError: the machine is empty.
        """
        return self._state.bounds

    @property
    def detached(self) -> tuple[str, ...]:
        """Ids of the blocks without a path to the starting block.

        A path runs over joints that hold and over connectors. In an assembly it is to lead to the
        starting block of the first sub-structure.
        """
        return self._state.detached()

    def to_document(self) -> dict[str, Any]:
        """Return the machine and its log as JSON values; `from_document` reads them."""
        return machine_document(self.log)

    @classmethod
    def from_document(cls, document: object, *, catalogue: Catalogue | None = None) -> Self:
        """Create the machine that a document describes.

        Args:
            document: result of `to_document`, JSON values.
            catalogue: modules that it may use. By default all types are known.

        Raises:
            DocumentError: it is not a machine; the message names the entry.
        """
        return cls.restored(read_machine(document, catalogue=catalogue))

    def _build(self, actions: Sequence[tuple[str, object]]) -> Outcome:
        """Execute actions until one is refused; each is recorded separately."""
        done: list[Accepted] = []
        for place, (name, arguments) in enumerate(actions, 1):
            outcome = self.act(name, arguments) if name in _OFFERED else _not_in_a_batch(name)
            if isinstance(outcome, Refused):
                where = f"Action {place} of {len(actions)} ({quote(name)}) was refused"
                text = f"{where}: {outcome.text} The {place - 1} before it are kept."
                return replace(outcome, text="\n".join([*(each.text for each in done), text]))
            assert isinstance(outcome, Accepted)  # noqa: S101  there are two kinds
            done.append(outcome)
        changed = tuple(part for each in done for part in each.changed)
        return Accepted(changed=changed, render=lambda: "\n".join(each.text for each in done))

    def _propose(self, name: object, arguments: object) -> Change:
        action = find_action(name) if isinstance(name, str) else None
        if action is None:
            text = f"There is no action {quote(name)}. Actions: {listing(_OFFERED)}."
            raise RefusalError(Cause.UNKNOWN_ACTION, text)
        return action.propose(self._state, **action.read(arguments))

    def _carry_out(self, change: Change) -> Accepted:
        if self._world is None:
            self._world = CollisionWorld()
            self._world.place(self._state.blocks.values())
        world = self._world
        placed = [change.after.blocks[block] for block in change.placed]
        _require_reach(placed)
        overlaps = unwanted(world.overlaps(placed), change.after.blocks)
        if overlaps:
            raise _overlap(change, overlaps)
        world.remove(change.removed)
        world.place(placed)
        before, self._state = self._state, change.after
        changed = (*change.placed, *change.touched, *change.removed)
        return Accepted(changed=changed, render=lambda: _rendered(before, change))

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle and deep-copy its state and log; the collision world is rebuilt."""
        return self.restored, (self.log,)

    def _record(self, name: object, arguments: object, outcome: Outcome) -> None:
        reason = None if isinstance(outcome, Accepted) else outcome.reason
        written = name if isinstance(name, str) else ""
        # A replay needs the complete arguments of an accepted action; a program is long.
        limits = {"longest": MAX_CONTROLLER_BYTES} if reason is None else {}
        self._records.append(
            ActionRecord(
                name=str(json_value(written)),
                arguments={} if arguments is None else json_value(arguments, **limits),
                reason=reason,
            )
        )


def replay(logged: LoggedState) -> Machine:
    """Repeat a machine's actions, including refused ones, and return the resulting machine."""
    available = {name: Machine.restored(inner) for name, inner in logged.available.items()}
    machine = Machine(catalogue=logged.state.catalogue, available=available)
    for record in logged.records:
        machine.act(record.name, record.arguments)
    return machine


def _not_in_a_batch(name: str) -> Refused:
    text = f"build carries out no {quote(name)}. Actions: {listing(_OFFERED)}."
    return Refused(cause=Cause.UNKNOWN_ACTION, text=text)


def _compared(state: MachineState) -> tuple[object, ...]:
    """Return the parts of a state that equality compares: not catalogues or available machines."""
    presses = (state.control_sequence, state.controller)
    return (state.parts, state.structures, state.structures_made, state.next_id, presses)


def _require_reach(blocks: Sequence[Block]) -> None:
    """Refuse blocks so far out that coordinates lack the precision to detect overlaps."""
    for block in blocks:
        if max(map(abs, block.world_from_block.xyz)) > LARGEST_NUMBER:
            text = f"Block {block.id} would lie farther out than {LARGEST_NUMBER:.0f}."
            raise RefusalError(Cause.OUT_OF_RANGE, text, attempted=tuple(blocks))


def _rendered(before: MachineState, change: Change) -> str:
    """Return an answer's text, with the action's effects on joints and gear wheels elsewhere."""
    shown_by_itself = change.placed if len(change.placed) == 1 else ()
    parts = {*before.connectors, *change.after.connectors}
    moved = change.placed or change.removed or parts.intersection(change.touched)
    effects = consequences(before, change.after, shown_by_itself) if moved else ()
    return " ".join([change.render(), *effects])


def _overlap(change: Change, overlaps: list[Overlap]) -> RefusalError:
    blocks = change.after.blocks
    if len(change.placed) == 1:
        named = listing(f"{title(blocks[o.other])} by {_depth(o)}" for o in overlaps)
        text = f"{change.attempt} would overlap {named}."
    else:
        named = "; ".join(f"{o.block} and {o.other} by {_depth(o)}" for o in overlaps)
        text = f"{change.attempt} would make blocks overlap: {named}."
    pairs = tuple((overlap.block, overlap.other) for overlap in overlaps)
    blocked = tuple(blocks[block_id] for block_id in change.placed)
    return RefusalError(Cause.OVERLAP, text, pairs, blocked)


def _depth(overlap: Overlap) -> str:
    """Format the depth with two digits, rounded up: moved by that, the blocks do not overlap."""
    return number(math.ceil(overlap.depth * 100.0 - _DIGITS) / 100.0)
