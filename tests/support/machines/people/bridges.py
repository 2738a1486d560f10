"""Bridges: beams, arches, king-posts and queen-posts, trusses, and decks that hang by ropes."""

import math
from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from typing import Final

from support.machines.drafts import KeyedDraft

from buildarena_geometry import Machine
from buildarena_worker.builtin.designs.drafting import (
    DOWN,
    EAST,
    NORTH,
    SOUTH,
    UP,
    WEST,
    Direction,
)

Cell = tuple[int, int, int]
"""East, north and up from the middle of the deck, in blocks."""

SIDE: Final = 2
"""How far from the middle the frames of a through bridge stand: the cargo lies between them."""
_WAYS: Final = (NORTH, SOUTH, EAST, WEST, UP, DOWN)


class Frame:
    """A bridge of blocks on a lattice, and of connectors between them.

    Args:
        cells: Where there are blocks, all of one piece; rows along north-south are laid first.
    """

    def __init__(self, cells: Iterable[Cell]) -> None:
        self.draft = KeyedDraft()
        self.blocks: dict[Cell, str] = {}
        wanted = set(cells)
        first = min(wanted, key=lambda cell: (abs(cell[0]), abs(cell[1]), abs(cell[2])))
        self.blocks[first] = self.draft.start()
        known = 0
        while known < len(self.blocks):
            known = len(self.blocks)
            for way in _WAYS:
                for cell in list(self.blocks):
                    self._lay_row(cell, way, wanted)
        missing = wanted - self.blocks.keys()
        if missing:
            raise ValueError(f"nothing leads to the blocks at {sorted(missing)}")

    def _lay_row(self, cell: Cell, way: Direction, wanted: set[Cell]) -> None:
        while True:
            after = _moved(cell, way)
            if after not in wanted or after in self.blocks:
                return
            self.blocks[after] = self.draft.attach(self.blocks[cell], way)
            cell = after

    def brace(
        self, first: Cell, second: Cell, way: Direction, other: Direction | None = None
    ) -> None:
        self.draft.connect(self.blocks[first], self.blocks[second], way, other)

    def rope(self, first: Cell, second: Cell, way: Direction, other: Direction) -> None:
        self.draft.connect(self.blocks[first], self.blocks[second], way, other, connector="Winch")

    @property
    def machine(self) -> Machine:
        return self.draft.machine


def _moved(cell: Cell, way: Direction) -> Cell:
    return (cell[0] + round(way[0]), cell[1] + round(way[1]), cell[2] + round(way[2]))


def beam(
    gap: int, *, overlap: int = 4, depth: int = 1, ways: Sequence[Direction] = (UP, DOWN)
) -> Machine:
    """A row, or several above each other, with overlapping braces.

    Args:
        gap: Width of the gap.
        overlap: Blocks that a brace spans.
        depth: Rows above each other.
        ways: On which sides there are braces.
    """
    half = gap // 2 + 1
    frame = Frame((0, y, z) for y in range(-half, half + 1) for z in range(depth))
    for way in ways:
        level = depth - 1 if way == UP else 0
        _overlapping(frame, [(0, y, level) for y in range(-half, half + 1)], overlap, way)
    return frame.machine


def box_girder(gap: int, *, overlap: int = 4) -> Machine:
    """Four rows round a hollow, joined by diaphragms."""
    half = gap // 2 + 1
    ring = [(x, z) for x in (-1, 0, 1) for z in (0, 1, 2) if (x, z) != (0, 1)]
    rows = [(x, z) for x in (-1, 1) for z in (0, 2)]
    ys = range(-half, half + 1)
    cells = {(x, y, z) for x, z in rows for y in ys}
    cells |= {(x, y, z) for x, z in ring for y in ys if y % 3 == 0}
    frame = Frame(cells)
    for x, z in rows:
        _overlapping(frame, [(x, y, z) for y in ys], overlap, UP if z else DOWN)
    return frame.machine


def arch(gap: int, *, rise: int, step: int = 2, width: int = 1) -> Machine:
    """A stepped arch that springs from the terrains, braced over and under its steps.

    Args:
        gap: Width of the gap.
        rise: Of the crown above the feet, in blocks.
        step: Blocks between one step and the next.
        width: Of the arch, in blocks: odd.
    """
    half = gap // 2 + 1

    def level(y: int) -> int:
        return max(rise - max(abs(y) - 1, 0) // step, 0)

    across = range(-(width // 2), width // 2 + 1)
    cells = {(x, y, level(y)) for x in across for y in range(-half, half + 1)}
    # Where the arch steps, its lower row reaches under the upper one.
    cells |= {
        (x, y - round(math.copysign(1, y)), level(y))
        for x in across
        for y in range(-half, half + 1)
        if y and level(y - round(math.copysign(1, y))) > level(y)
    }
    frame = Frame(cells)
    for x in across:
        for way in (UP, DOWN):
            line = [_outermost(cells, x, y, way) for y in range(-half, half + 1)]
            _overlapping(frame, line, 3, way)
            _overlapping(frame, line, 5, way)
    return frame.machine


def king_post(gap: int, *, height: int = 3) -> Machine:
    """A through bridge: a post on both sides of the middle, braces from its top to the ends."""
    half = gap // 2 + 1
    frame = _through(half, {(side, 0, z) for side in (-SIDE, SIDE) for z in range(height + 1)})
    for side in (-SIDE, SIDE):
        for end, toward in ((-half, SOUTH), (half, NORTH)):
            frame.brace((side, 0, height), (side, end, 0), toward, UP)
    return frame.machine


def queen_post(gap: int, *, height: int = 3) -> Machine:
    """A through bridge: two posts on each side with a straining beam between their tops."""
    half = gap // 2 + 1
    place = max(half // 2, 2)
    posts = {
        (side, y, z) for side in (-SIDE, SIDE) for y in (-place, place) for z in range(height + 1)
    }
    chords = {(side, y, height) for side in (-SIDE, SIDE) for y in range(-place, place + 1)}
    frame = _through(half, posts | chords)
    for side in (-SIDE, SIDE):
        for sign, toward in ((-1, SOUTH), (1, NORTH)):
            frame.brace((side, sign * place, height), (side, sign * half, 0), toward, UP)
    return frame.machine


def truss(gap: int, *, kind: str = "pratt", height: int = 3, panel: int = 2) -> Machine:
    """A through bridge of two trusses: posts between two chords, and diagonals.

    Args:
        gap: Width of the gap.
        kind: "pratt": diagonals fall towards the middle; "howe": they rise towards it; "warren":
            they alternate and there are no posts but at the ends; "cross": both ways.
        height: Of the upper chord above the lower, in blocks.
        panel: Blocks between posts.
    """
    half = gap // 2 + 1
    nodes = [y for y in range(-half, half + 1) if (y + half) % panel == 0]
    if nodes[-1] != half:
        nodes.append(half)
    posts = nodes if kind != "warren" else [nodes[0], nodes[-1]]
    cells = {(side, y, z) for side in (-SIDE, SIDE) for y in posts for z in range(height + 1)}
    cells |= {(side, y, height) for side in (-SIDE, SIDE) for y in range(-half, half + 1)}
    frame = _through(half, cells)
    falls: dict[str, Callable[[int, int], Sequence[bool]]] = {
        "pratt": lambda _, y: [y < 0],
        "howe": lambda _, y: [y >= 0],
        "warren": lambda k, _: [k % 2 == 0],
        "cross": lambda _k, _y: [True, False],
    }
    for side in (-SIDE, SIDE):
        for k, (y, after) in enumerate(pairwise(nodes)):
            for northwards in falls[kind](k, y):
                high, low = (y, after) if northwards else (after, y)
                frame.brace((side, high, height), (side, low, 0), _outwards(side), _outwards(side))
    return frame.machine


def hung(gap: int, *, height: int = 4, hangers: int = 2) -> Machine:
    """A deck that hangs by ropes from four towers on the terrains.

    Args:
        gap: Width of the gap.
        height: Of the towers above the deck, in blocks.
        hangers: Ropes from the top of each tower, each two blocks farther from the last.
    """
    half = gap // 2 + 2
    towers = {
        (side, end, z) for side in (-SIDE, SIDE) for end in (-half, half) for z in range(height + 1)
    }
    frame = _through(half, towers)
    for side in (-SIDE, SIDE):
        for end, toward in ((-half, NORTH), (half, SOUTH)):
            for k in range(hangers):
                away = half - 2 * (k + 1)
                place = away if end > 0 else -away
                frame.rope((side, end, height), (side, place, 0), toward, UP)
    return frame.machine


def _through(half: int, further: Iterable[Cell]) -> Frame:
    """A deck of five rows under frames at its sides, its outer and middle rows braced."""
    ys = range(-half, half + 1)
    cells = {(x, y, 0) for x in (-SIDE, 0, SIDE) for y in ys}
    cells |= {(x, y, 0) for x in (-1, 1) for y in ys if abs(y) <= 1 or y % 2 == half % 2}
    frame = Frame(cells | set(further))
    for x in (-SIDE, 0, SIDE):
        _overlapping(frame, [(x, y, 0) for y in ys], 4, DOWN)
    for y in ys:
        if (1, y, 0) in cells:
            frame.brace((-SIDE, y, 0), (0, y, 0), DOWN)
            frame.brace((0, y, 0), (SIDE, y, 0), DOWN)
    return frame


def _overlapping(frame: Frame, line: Sequence[Cell], overlap: int, way: Direction) -> None:
    for first, second in zip(line, line[overlap:], strict=False):
        frame.brace(first, second, way)


def _outermost(cells: set[Cell], x: int, y: int, way: Direction) -> Cell:
    levels = [z for cx, cy, z in cells if (cx, cy) == (x, y)]
    return (x, y, max(levels) if way == UP else min(levels))


def _outwards(side: int) -> Direction:
    return EAST if side > 0 else WEST
