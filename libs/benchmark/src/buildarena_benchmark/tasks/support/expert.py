"""Bridges: a row of blocks, or a deck of three, stiffened by overlapping braces."""

# BuildArena benchmark data, not for training corpora:
# canary 3ab839c7-e533-462b-9729-71495c1ee1f6

from collections.abc import Sequence
from functools import partial
from typing import Final

from buildarena_benchmark.experts.design import Design, Designs, one_part
from buildarena_benchmark.experts.drafting import (
    DOWN,
    EAST,
    NORTH,
    SOUTH,
    UP,
    WEST,
    Direction,
    Draft,
)

OVERLAP = 4
"""Blocks that a brace spans: braces that overlap share the load of several joints."""


def braced_beam(seed: int, *, gap: int) -> Design:
    """Return a single row of blocks with braces above and below.

    Args:
        seed: Varies the beam's rest on the terrain, by a block at each end.
        gap: Width of the gap, units.
    """
    draft = Draft()
    row = _row(draft, draft.start("middle of the beam"), _half(seed, gap))
    for way in (UP, DOWN):
        _brace(draft, row, way)
    return _bridge(draft, gap, f"A row of {len(row)} blocks from south to north, braced both sides")


def braced_deck(
    seed: int,
    *,
    gap: int,
    ways: Sequence[Direction] = (UP,),
    overlap: int = OVERLAP,
    spacing: int = 1,
) -> Design:
    """Return three rows side by side, held together across, with braces along them.

    Args:
        gap: Width of the gap, units.
        ways: Sides on which the rows have braces.
        overlap: Blocks that a brace spans.
        spacing: Blocks from one joint across to the next.
    """
    draft = Draft()
    middle = draft.start("middle of the deck")
    starts = [draft.attach(middle, WEST), middle, draft.attach(middle, EAST)]
    rows = [_row(draft, start, _half(seed, gap)) for start in starts]
    for west, centre, east in list(zip(*rows, strict=True))[::spacing]:
        draft.connect(west, centre, UP)
        draft.connect(centre, east, UP)
    for row in rows:
        for way in ways:
            _brace(draft, row, way, overlap)
    sides = "on top" if len(ways) == 1 else "both sides"
    return _bridge(
        draft, gap, f"3 rows of {len(rows[0])} blocks from south to north, braced {sides}"
    )


def long_deck(seed: int) -> Design:
    """Return a deck for a gap of 30 that is built in fewer turns than a session has."""
    return braced_deck(seed, gap=30, ways=(UP, DOWN), overlap=8 + seed % 2, spacing=9)


def _half(seed: int, gap: int) -> int:
    return gap // 2 + 1 + seed % 2


def _row(draft: Draft, middle: str, half: int) -> list[str]:
    """Return the blocks to the north and south of one, from south to north."""
    ahead = draft.row(middle, NORTH, half)
    behind = draft.row(middle, SOUTH, half)
    return [*reversed(behind), middle, *ahead]


def _brace(draft: Draft, row: Sequence[str], way: Direction, overlap: int = OVERLAP) -> None:
    for first, second in zip(row, row[overlap:], strict=False):
        draft.connect(first, second, way)


def _bridge(draft: Draft, gap: int, description: str) -> Design:
    overall = f"A bridge over the gap of {gap} that rests on both terrains by its own weight."
    return one_part(draft, "bridge", description, overall=overall)


DESIGNS: Final[Designs] = {
    "support-1": partial(braced_beam, gap=5),
    "support-2": partial(braced_deck, gap=10),
    "support-3": partial(braced_beam, gap=20),
    "support-4": long_deck,
}
