"""A suspension bridge of our own design: a deck that hangs by ropes from two towers."""

from collections.abc import Mapping

from buildarena_worker.builtin.designs.drafting import (
    DOWN,
    EAST,
    NORTH,
    SOUTH,
    UP,
    WEST,
    Action,
    Draft,
)

HALF = 6
"""Blocks of the deck to the north and to the south of its middle."""
HEIGHT = 3
"""Blocks of a tower's legs above the deck's level."""
STRIDE = 4
"""Blocks that a brace along the deck reaches over."""
HANGERS = (1, 3)
"""How far from the middle the ropes hold the deck, in blocks."""


def suspension_bridge(*, roped: bool = True) -> Mapping[str, list[Action]]:
    """The actions that build it, by machine: ``deck``, ``tower`` and ``assembly``."""
    deck, rows = _deck()
    tower, legs, beam = _tower()
    whole = Draft({"deck": deck.machine, "tower": tower.machine})
    whole.do("add_machine", machine_id="deck", init_shift=[0, 0, 0])
    for side in (-1, 1):
        whole.do("add_machine", machine_id="tower", init_shift=[0, side * HALF, HEIGHT])
    for letter, sign in (("B", -1), ("C", 1)):
        end = sign * HALF
        for (x, leg), edge in zip(legs.items(), (-1, 1), strict=True):
            assert x * edge > 0
            whole.connect(f"A_{rows[edge, end]}", f"{letter}_{leg}", UP)
        for x, held in beam.items():
            for away in HANGERS if roped else ():
                low = f"A_{rows[x, sign * away]}"
                whole.connect(f"{letter}_{held}", low, DOWN, UP, connector="Winch")
    return {"deck": deck.actions, "tower": tower.actions, "assembly": whole.actions}


def _deck() -> tuple[Draft, dict[tuple[int, int], str]]:
    """Three rows of blocks from south to north, braced underneath and held together on top."""
    draft = Draft()
    middle = draft.start("middle of the deck")
    rows: dict[tuple[int, int], str] = {(0, 0): middle}
    for x, way in ((-1, WEST), (1, EAST)):
        rows[x, 0] = draft.attach(middle, way)
    for x in (-1, 0, 1):
        for sign, way in ((1, NORTH), (-1, SOUTH)):
            made = draft.row(rows[x, 0], way, HALF)
            rows |= {(x, sign * (n + 1)): block for n, block in enumerate(made)}
    for y in range(-HALF, HALF + 1):
        draft.connect(rows[-1, y], rows[0, y], DOWN)
        draft.connect(rows[0, y], rows[1, y], DOWN)
        for x in (-1, 0, 1):
            if (x, y + STRIDE) in rows:
                draft.connect(rows[x, y], rows[x, y + STRIDE], DOWN)
    return draft, rows


def _tower() -> tuple[Draft, dict[int, str], dict[int, str]]:
    """A gate over the deck's end: two legs beside it and a beam on top.

    Returns:
        The draft, the legs' lowest blocks and the beam's blocks over the deck's edges, by x.
    """
    draft = Draft()
    middle = draft.start("middle of the beam")
    beam = {0: middle}
    legs: dict[int, str] = {}
    for sign, way in ((-1, WEST), (1, EAST)):
        arm = draft.row(middle, way, 2)
        beam |= {sign * (n + 1): block for n, block in enumerate(arm)}
        legs[2 * sign] = draft.row(arm[-1], DOWN, HEIGHT)[-1]
        draft.connect(arm[0], arm[1], UP)
    draft.connect(beam[-1], beam[1], UP)
    return draft, legs, {x: beam[x] for x in (-1, 1)}
