"""Bridges: a deck across the gap, its rows held together by braces on both sides."""

from __future__ import annotations

from buildarena_worker.builtin.designs.design import (
    DOWN,
    EAST,
    NORTH,
    SOUTH,
    UP,
    WEST,
    Design,
    PartDesign,
    Place,
    Sketch,
)

HALF_WIDTH = 2
"""Columns on each side of the middle: the cargo is 2.5 wide and lands on the middle three."""
BRACE_REACH = 4
"""Blocks that one brace bridges: overlapping braces share the load of several joints."""


def bridge(seed: int, *, gap: int) -> Design:
    """A deck five blocks wide.

    Args:
        seed: Varies how far the deck rests on the terrain, between 1 and 2 blocks more.
        gap: Width of the gap, units.
    """
    half_length = gap // 2 + 2 + seed % 2
    sketch = Sketch()
    sketch.start("middle of the deck")
    for side in (EAST, WEST):
        for step in range(HALF_WIDTH):
            sketch.attach((side[0] * step, 0.0, 0.0), side, note="middle row")
    for column in range(-HALF_WIDTH, HALF_WIDTH + 1):
        for way in (NORTH, SOUTH):
            for step in range(half_length):
                sketch.attach((float(column), way[1] * step, 0.0), way, note=f"column {column}")
    _brace_along(sketch, half_length)
    _brace_across(sketch, half_length)
    length = 2 * half_length + 1
    description = (
        f"A flat deck, {2 * HALF_WIDTH + 1} blocks wide (east-west) and {length} long "
        "(north-south), of small wooden blocks, with overlapping braces above and below"
    )
    return Design(
        overall=f"A braced deck that rests on both terrains and spans the gap of {gap}.",
        parts={"deck": PartDesign(description=description, actions=tuple(sketch.actions))},
    )


def _brace_along(sketch: Sketch, half_length: int) -> None:
    """Overlapping braces along every column, above and below, where the deck bends most."""
    for column in range(-HALF_WIDTH, HALF_WIDTH + 1):
        for normal in (UP, DOWN):
            for south in range(-half_length, half_length - BRACE_REACH + 1, 2):
                start: Place = (float(column), float(south), 0.0)
                end: Place = (float(column), float(south + BRACE_REACH), 0.0)
                sketch.connect((start, normal), (end, normal), note="along")


def _brace_across(sketch: Sketch, half_length: int) -> None:
    """Braces across the columns, which hang together by the middle row alone."""
    for row in range(-half_length, half_length + 1, 2):
        start: Place = (float(-HALF_WIDTH), float(row), 0.0)
        end: Place = (float(HALF_WIDTH), float(row), 0.0)
        sketch.connect((start, DOWN), (end, DOWN), note="across")
