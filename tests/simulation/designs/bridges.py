"""Bridges: beams, decks, lattices."""

from collections.abc import Sequence

from tests.simulation.designs.draft import (
    DOWN,
    EAST,
    NORTH,
    SOUTH,
    UP,
    WEST,
    Actions,
    Direction,
    Draft,
)


def beam(length: int = 7, braces: str = "", direction: Direction = NORTH) -> Actions:
    """A single row of blocks.

    Args:
        length: Odd number of blocks.
        braces: Which braces: "t" every seam on top, "b" below, "T" and "B" one from end to end,
            "1" and "2" overlapping ones of length 4 on top and below.
        direction: Where it runs.
    """
    draft = Draft()
    middle = draft.start()
    back = tuple(-d for d in direction)
    ahead = draft.row(middle, direction, length // 2)
    behind = draft.row(middle, back, length // 2)  # type: ignore[arg-type]
    row = [*reversed(behind), middle, *ahead]
    for kind in braces:
        way = UP if kind in "tT1" else DOWN
        reach = {"t": 1, "b": 1, "1": 4, "2": 4}.get(kind, length - 1)
        for first, second in zip(row, row[reach:], strict=False):
            draft.connect(first, second, way)
    return draft.actions


def deck(
    width: int = 5,
    length: int = 7,
    *,
    cross: bool = False,
    along: str = "",
    rails: bool = False,
    pillars: int = 0,
    pillar_at: Sequence[tuple[int, int]] = ((0, 1), (0, -1)),
) -> Actions:
    """A deck of rows along north-south that hang on one row along east-west.

    Args:
        width: Odd number of rows.
        length: Odd number of blocks per row.
        cross: Whether every east-west seam is braced on top.
        along: Braces along the rows, as in `beam`.
        rails: Whether three blocks stand at the middle of each long side.
        pillars: Height of the pillars below the deck; 0 for none.
        pillar_at: Where they are: row and block, counted from the middle.
    """
    draft = Draft()
    grid = _deck_grid(draft, width // 2, length // 2)
    if rails:
        for x in (-(width // 2), width // 2):
            for y in (-1, 0, 1):
                draft.attach(grid[x, y], UP)
    for place in pillar_at if pillars else ():
        draft.row(grid[place], DOWN, pillars)
    if cross:
        _brace_grid(draft, grid, (1, 0), UP)
    for kind in along:
        reach = {"t": 1, "b": 1, "1": 4, "2": 4}.get(kind, length - 1)
        _brace_grid(draft, grid, (0, reach), UP if kind in "tT1" else DOWN)
    return draft.actions


def _deck_grid(draft: Draft, across: int, along: int) -> dict[tuple[int, int], str]:
    """Blocks of a deck by row and place, counted from the middle."""
    grid = {(0, 0): draft.start()}
    for sign, way in ((1, EAST), (-1, WEST)):
        for x, block in enumerate(draft.row(grid[0, 0], way, across), 1):
            grid[sign * x, 0] = block
    for x in range(-across, across + 1):
        for sign, way in ((1, NORTH), (-1, SOUTH)):
            for y, block in enumerate(draft.row(grid[x, 0], way, along), 1):
                grid[x, sign * y] = block
    return grid


def _brace_grid(
    draft: Draft, grid: dict[tuple[int, int], str], step: tuple[int, int], way: Direction
) -> None:
    """A brace from every block to the one a step further on."""
    for x, y in sorted(grid, key=lambda place: place[:: -1 if step[0] else 1]):
        further = grid.get((x + step[0], y + step[1]))
        if further is not None:
            draft.connect(grid[x, y], further, way)


def lattice(width: int, length: int, brace_count: int) -> Actions:
    """A plain deck with some of its east-west seams braced; for measurements of speed.

    Args:
        width: Odd number of rows.
        length: Odd number of blocks per row.
        brace_count: How many seams are braced.
    """
    draft = Draft()
    grid = _deck_grid(draft, width // 2, length // 2)
    seams = [(x, y) for x, y in sorted(grid) if (x + 1, y) in grid]
    for x, y in seams[:: len(seams) // brace_count][:brace_count]:
        draft.connect(grid[x, y], grid[x + 1, y], DOWN)
    return draft.actions


def one_shot_bridge() -> Actions:
    """The bridge of the paper's one-shot example, which is reported to carry 1000."""
    return deck(5, 7, cross=True, rails=True, pillars=5)


# Vehicles
