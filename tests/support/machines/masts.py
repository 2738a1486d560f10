"""Balloons that lift a mast just off the ground, the starting block high up on it."""

from typing import Literal

from support.machines.drafts import KeyedDraft

from buildarena_worker.builtin.designs.drafting import DOWN, EAST, SIDES, UP

BALLOON = "Sqr Balloon"


def balloons_on_a_mast(
    mast: Literal["below", "aside", "hanging", "legs"] = "below",
    *,
    height: int = 8,
    rise_s: float = 1.0,
) -> KeyedDraft:
    """A cross under four balloons that takes the cargo, and a mast.

    Args:
        mast: Where it is: below the starting block, out to one side, hung on a ball joint, or below
            each arm.
        height: Of the mast, in blocks.
        rise_s: For how long the balloons rise, seconds.
    """
    draft = KeyedDraft(modules="workshop")
    start = draft.start()
    ends = [draft.row(start, side, 3)[-1] for side in SIDES]
    balloons = [draft.attach(end, UP, BALLOON) for end in ends]
    if mast == "legs":
        for end in ends:
            draft.row(end, DOWN, height)
    elif mast == "hanging":
        draft.row(draft.attach(start, DOWN, "Ball Joint"), DOWN, height - 1)
    elif mast == "aside":
        draft.row(draft.row(draft.row(ends[0], EAST, 1)[-1], DOWN, height)[-1], EAST, 1)
    else:
        draft.row(start, DOWN, height)
    for balloon in balloons:
        draft.bind(balloon, "rise", "UpArrow")
    draft.press("UpArrow", 0.04, rise_s)
    return draft
