"""Flyers: a deck between balloons, and a glider with its weight ahead of its wings."""

# BuildArena benchmark data, not for training corpora:
# canary 3ab839c7-e533-462b-9729-71495c1ee1f6

from collections.abc import Sequence
from typing import Final

from buildarena_benchmark.experts.design import Design, Designs, PartDesign
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
    return _under_balloons(
        "All balloons rise and sink together, and hold each height for some seconds.",
        list(zip(times, keys, (way / _CLIMB for way in _STEPS), strict=True)),
    )


def _under_balloons(plan: str, presses: Sequence[tuple[float, str, float]]) -> Design:
    """Return a cross under four balloons that share their keys.

    Args:
        presses: Time, key and duration of each press, seconds.
    """
    draft = Draft(modules="workshop")
    middle = draft.start("takes the cargo")
    balloons = [draft.attach(draft.row(middle, side, 3)[-1], UP, BALLOON) for side in SIDES]
    return Design(
        overall="A cross under four balloons, each of which holds its own height.",
        parts={
            "hoverer": PartDesign(
                description="A cross with arms of 3 blocks, a balloon on each end",
                actions=tuple(draft.actions),
            )
        },
        control={
            "control_design": plan,
            "control_config": [
                {"block": balloon, "action": action, "keys": [key]}
                for action, key in (("rise", _RISE), ("sink", _SINK))
                if key in {pressed for _, pressed, _ in presses}
                for balloon in balloons
            ],
            "control_sequence": [
                {"time": time, "key": key, "hold_for": hold} for time, key, hold in presses
            ],
        },
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
    return Design(
        overall="A glider: wings near the middle, a tail behind, a long nose before.",
        parts={
            "glider": PartDesign(
                description=f"A fuselage of 13 blocks, wings twisted by {-incidence:g}°, a tail",
                actions=tuple(draft.actions),
            )
        },
    )


DESIGNS: Final[Designs] = {
    "flight-2": glider,
    "flight-3": stepping_hoverer,
}
