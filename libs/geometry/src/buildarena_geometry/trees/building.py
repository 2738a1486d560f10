"""Builds construction trees by the library's own actions, each of them checked."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from buildarena_geometry.errors import TreeError
from buildarena_geometry.rotations import cross, dot
from buildarena_geometry.trees.points import turned_x_axis

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from buildarena_geometry.machine import Machine
    from buildarena_geometry.outcomes import Outcome
    from buildarena_geometry.trees.reading import TreeEntry

_FLIPPED: Final = frozenset({2, 46})
"""Types that BesiegeField flips where they point west, so that wheels of both sides roll north."""
_WEST: Final = -1.0 + 1e-6
_DIGITS: Final = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class TreeAction:
    """One action of building a tree, and what came of it."""

    name: str
    arguments: Mapping[str, Any]
    outcome: Outcome


def tree_actions(
    entries: Sequence[TreeEntry],
    machine: Machine,
    act: Callable[[str, Mapping[str, Any]], Outcome] | None = None,
) -> Iterator[TreeAction]:
    """Builds a tree, action by action: what was there is removed first.

    A block is attached, turned as the tree has it where the library turns it otherwise, and flipped
    where BesiegeField flips it.

    Args:
        entries: As `read_tree` returns them.
        machine: What is built.
        act: Carries an action out; the machine's own if left out.

    Raises:
        TreeError: An action is refused, after it was given out; the message names its entry.
    """
    builder = _Builder(machine, act or machine.act)
    if machine.started:
        yield from builder.act(entries[0], "reset", {})
    for entry in entries:
        yield from builder.add(entry)


class _Builder:
    def __init__(self, machine: Machine, act: Callable[[str, Mapping[str, Any]], Outcome]) -> None:
        self._machine = machine
        self._act = act
        self._ids: dict[int, str] = {}

    def act(
        self, entry: TreeEntry, name: str, arguments: Mapping[str, Any]
    ) -> Iterator[TreeAction]:
        outcome = self._act(name, arguments)
        yield TreeAction(name=name, arguments=arguments, outcome=outcome)
        if not outcome.ok:
            raise TreeError(
                f"{entry.title}: {outcome.text} (Blocks are counted from 1, in the order of the "
                "entries.)"
            )

    def add(self, entry: TreeEntry) -> Iterator[TreeAction]:
        """Adds one entry's part."""
        number = str(self._machine.state.next_id)
        if not entry.parents:
            yield from self.act(entry, "start", {})
        elif len(entry.parents) == 1:
            yield from self._attach(entry, number)
        else:
            (a, face_a), (b, face_b) = entry.parents
            arguments = {
                "block_a": self._ids[a],
                "face_a": face_a,
                "block_b": self._ids[b],
                "face_b": face_b,
                "connector": entry.module.name,
            }
            yield from self.act(entry, "connect_blocks", arguments)
        self._ids[entry.number] = number

    def _attach(self, entry: TreeEntry, number: str) -> Iterator[TreeAction]:
        ((parent, face),) = entry.parents
        arguments = {
            "base_block": self._ids[parent],
            "face": face,
            "new_block": entry.module.name,
        }
        yield from self.act(entry, "attach_block_to", arguments)
        block = self._machine.blocks[number]
        normal = self._machine.blocks[self._ids[parent]].face_normal(face)
        ours, theirs = block.world_from_block.direction((1.0, 0.0, 0.0)), turned_x_axis(normal)
        # twist_block turns clockwise seen from outside, against the right-hand rule.
        turn = -math.degrees(math.atan2(dot(normal, cross(ours, theirs)), dot(ours, theirs)))
        angle = round(turn, _DIGITS) % 360
        if angle:
            yield from self.act(entry, "twist_block", {"block_id": number, "angle": angle})
        if entry.module.besiege_id in _FLIPPED and normal[0] < _WEST:
            yield from self.act(entry, "flip_spin", {"block_id": number})
