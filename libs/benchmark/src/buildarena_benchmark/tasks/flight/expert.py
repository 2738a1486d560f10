"""Flyers: a deck between balloons, and a glider with its weight ahead of its wings."""

# BuildArena benchmark data, not for training corpora:
# canary 3ab839c7-e533-462b-9729-71495c1ee1f6

from typing import Final

from buildarena_benchmark.experts.design import Design, Designs, keyed, one_part
from buildarena_benchmark.experts.drafting import EAST, NORTH, SIDES, SOUTH, UP, WEST, Draft

BALLOON, WING = "Sqr Balloon", "Wing Panel"
_CLIMB: Final = 2.0
"""Rate at which the height rises that a balloon holds, units/s."""
_RISE, _SINK = "UpArrow", "DownArrow"
_STEPS: Final = (8.7, 6.0, 3.0)
"""The three heights above the ground, above the first, and below the second, units."""
_LATER_S: Final = (12.5, 22.0)
"""Times of the second height and of the third, after it first begins to rise, seconds."""


def stepping_hoverer(seed: int) -> Design:
    """Return four balloons round a cross with the cargo: it rises, holds, rises, holds, sinks."""
    begin = 0.3 + 0.04 * (seed % 5)
    times = (begin, *(begin + later for later in _LATER_S))
    keys = (_RISE, _RISE, _SINK)
    draft = Draft(modules="workshop")
    middle = draft.start("takes the cargo")
    balloons = [draft.attach(draft.row(middle, side, 3)[-1], UP, BALLOON) for side in SIDES]
    return one_part(
        draft,
        "hoverer",
        "A cross with arms of 3 blocks, a balloon on each end",
        overall="A cross under four balloons, each of which holds its own height.",
        control=keyed(
            "All balloons rise and sink together, and hold each height for some seconds.",
            [
                (balloon, action, key)
                for action, key in (("rise", _RISE), ("sink", _SINK))
                for balloon in balloons
            ],
            zip(times, keys, (way / _CLIMB for way in _STEPS), strict=True),
        ),
    )


def glider(seed: int) -> Design:
    """Return a glider: two panels to a side at a few degrees, a level tail, a nose for balance."""
    incidence = -5.0 - seed % 4
    draft = Draft(modules="workshop")
    middle = draft.start("carries the wings")
    draft.row(middle, NORTH, 5)
    tail = draft.row(middle, SOUTH, 7)[-1]
    for side, sense in ((EAST, 1), (WEST, -1)):
        root = draft.attach(middle, side, WING)
        draft.turn_axis(root, 1, UP, further_deg=sense * incidence)
        draft.attach(root, side, WING)
        draft.turn_axis(draft.attach(tail, side, WING), 1, UP)
    return one_part(
        draft,
        "glider",
        f"A fuselage of 13 blocks, wings twisted by {-incidence:g}°, a tail",
        overall="A glider: wings near the middle, a tail behind, a long nose before.",
    )


DESIGNS: Final[Designs] = {
    "flight-2": glider,
    "flight-3": stepping_hoverer,
}
