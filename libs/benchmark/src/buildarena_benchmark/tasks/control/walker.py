"""Machines that walk: a body on four legs carries inner feet ahead, which then carry the body."""

# BuildArena benchmark data, not for training corpora:
# canary 3ab839c7-e533-462b-9729-71495c1ee1f6

from typing import Final

from buildarena_benchmark.experts.design import Design, one_part
from buildarena_benchmark.experts.drafting import DOWN, EAST, NORTH, SOUTH, UP, WEST, Draft
from buildarena_benchmark.experts.programs import listed, program_text, quoted

_HALF_WIDTH, _HALF_LENGTH = 2, 2
_INNER_LENGTH: Final = 5
_PISTONS: Final = 2
"""Number of pistons one behind the other: a stroke of 2 each way."""


def walker(seed: int) -> Design:
    """Return two frames on feet, joined by a hinge that steers, and pistons that push and lift.

    It goes north, wherever it faces at the start. The hinge's pin is above the starting block, so
    that the body turns on the spot.
    """
    draft = Draft(modules="workshop")
    middle = draft.start("middle of the body")
    behind = draft.row(middle, SOUTH, 1)[-1]
    hinge = draft.attach(draft.attach(behind, UP), NORTH, "Steering Hinge")
    draft.turn_axis(hinge, 0, UP)
    slides = _pistons(draft, hinge, NORTH)
    lifts = _pistons(draft, slides[-1], DOWN)
    body = _body(draft, middle)
    inner = _inner(draft, draft.attach(lifts[-1], DOWN))
    places = {"slides": listed(slides), "lifts": listed(lifts)}
    places |= {"body_feet": listed(body), "inner_feet": listed(inner)}
    places["keen"] = f"{0.2 + 0.02 * (seed % 5):g}"
    return one_part(
        draft,
        "walker",
        "A body on four legs; on it a hinge, two pistons in a row to the "
        "north, two downwards, and a frame on four feet",
        overall="A body on four legs and a frame on four feet within, which carry each other on.",
        program=program_text(__package__, "north", **quoted({"hinge": hinge}))
        + program_text(__package__, "walk", **quoted({"hinge": hinge}), **places),
    )


def _pistons(draft: Draft, base: str, way: tuple[int, int, int]) -> list[str]:
    pistons = []
    for _ in range(_PISTONS):
        base = draft.attach(base, way, "Piston")
        pistons.append(base)
    return pistons


def _body(draft: Draft, middle: str) -> list[str]:
    """Build a cross member with a rail at either end, and legs under the rails; return their feet.

    Braces lead from the middle to the corners: what a leg strikes bends the cross member.
    """
    feet = []
    for side in (EAST, WEST):
        end = draft.row(middle, side, _HALF_WIDTH)[-1]
        for way in (NORTH, SOUTH):
            corner = draft.row(end, way, _HALF_LENGTH)[-1]
            draft.connect(middle, corner, UP)
            feet.append(draft.attach(draft.attach(corner, DOWN, "Log"), DOWN))
    return feet


def _inner(draft: Draft, front: str) -> list[str]:
    """Build a spine below the pistons, mostly to the south, with feet at its ends; return them."""
    ends = draft.row(front, NORTH, 1)[-1], draft.row(front, SOUTH, _INNER_LENGTH)[-1]
    return [draft.attach(draft.attach(base, side), DOWN) for base in ends for side in (EAST, WEST)]
