"""Vehicles that keep a ball between two prongs and push it."""

# BuildArena benchmark data, not for training corpora:
# canary 3ab839c7-e533-462b-9729-71495c1ee1f6

from typing import Final

from buildarena_benchmark.experts.design import Design, Designs, keyed, one_part
from buildarena_benchmark.experts.drafting import DOWN, EAST, NORTH, SOUTH, UP, WEST, Draft

_PRONG = 2
"""Length of a prong, blocks: longer ones strike a ramp that bends upwards."""
_BEGINS_S = (0.4, 0.48, 0.56, 0.64, 0.72)
"""Time at which it drives off, by seed, seconds."""
_SAMPLE_S = 0.04
_LEFT, _RIGHT, _AHEAD, _BACK = "LeftArrow", "RightArrow", "UpArrow", "DownArrow"
_TRACK = (
    (0.4, _AHEAD, 19.0),
    (1.72, _RIGHT, 0.32),
    (3.24, _LEFT, 0.24),
    (4.04, _LEFT, 0.48),
    (5.76, _RIGHT, 0.48),
)
"""Start, key and duration of each press of the car that bends, seconds; from a search."""
_OVER_THE_TOP = (*((0.16 * k, 0.053 + 0.0093 * k) for k in range(12)), (1.92, 3.47))
"""Start and duration of the crane's turns, seconds: its pace rises from a third to the whole, so
that the arm keeps up with its drive and does not catch up by a jerk that lets the weight bounce."""


def courier(seed: int) -> Design:
    """Return a car of four wheels with a fork in front, as wide as the ball and a little more."""
    draft = Draft(modules="workshop")
    middle = draft.start("between the axles")
    front = draft.row(middle, NORTH, 2)[-1]
    back = draft.row(middle, SOUTH, 2)[-1]
    wheels = []
    for base, is_front in ((front, True), (back, False)):
        for side in (EAST, WEST):
            end = draft.row(base, side, 2)[-1]
            wheels.append(draft.wheel(end, side))
            if is_front:
                draft.row(end, NORTH, _PRONG)
    return one_part(
        draft,
        "courier",
        "A spine of 5, two cross members of 5, four wheels, two prongs of 2",
        overall="A car that pushes the ball ahead, between two prongs.",
        control=keyed(
            "All wheels drive north until the trial ends.",
            [(wheel, "spinning_forward", "UpArrow") for wheel in wheels],
            [(_BEGINS_S[seed % len(_BEGINS_S)], "UpArrow", 19.0)],
        ),
    )


def track_follower(seed: int) -> Design:
    """Return a car as narrow as its wheels that bends in its middle, steered through two bends."""
    begin = 2 * _SAMPLE_S * (seed % 4)
    draft = Draft(modules="workshop")
    middle = draft.start("behind the joint")
    joint = draft.attach(middle, NORTH, "Steering Hinge")
    draft.turn_axis(joint, 0, UP)
    front, back = draft.attach(joint, NORTH), draft.row(middle, SOUTH, 2)[-1]
    wheels = [draft.wheel(base, side) for base in (front, back) for side in (EAST, WEST)]
    bindings = [(joint, "turn_left", _LEFT), (joint, "turn_right", _RIGHT)]
    for wheel in wheels:
        bindings += [(wheel, "spinning_forward", _AHEAD), (wheel, "spinning_backward", _BACK)]
    return one_part(
        draft,
        "car",
        "Two axles of two wheels each, and a steering hinge between them",
        overall="A narrow car on four wheels that bends in its middle.",
        control=keyed(
            "Right, straight on, left.",
            bindings,
            [(round(begin + time, 2), key, hold) for time, key, hold in _TRACK],
        ),
    )


def well_crane(seed: int) -> Design:
    """Return a high arm with a counterweight; its long hand fetches the ball out of a well."""
    begin = 0.6 + 0.1 * (seed % 5)
    draft = Draft(modules="workshop")
    middle = draft.start("under the post")
    for side in (EAST, WEST):
        end = draft.row(middle, side, 4)[-1]
        for way, count in ((NORTH, 4), (SOUTH, 3)):
            draft.row(end, way, count)
    post = draft.row(middle, UP, 7)
    for base, side in (("5", EAST), ("16", WEST)):
        draft.connect(post[-1], base, side, UP)
    shoulder = draft.attach(post[-1], NORTH, "Steering Block")
    root = draft.attach(shoulder, NORTH)
    arm = draft.row(root, WEST, 8)
    draft.connect(root, arm[4], UP)
    for block in draft.row(root, EAST, 5)[2:]:
        for way in (NORTH, SOUTH, UP, DOWN):
            draft.attach(block, way, "Log", note="counterweight")
    # A block further out than the arm is wide: so the hand passes it at the top.
    hand = draft.attach(draft.attach(arm[-1], NORTH), NORTH, "Swivel")
    link = draft.row(hand, DOWN, 2)[-1]
    # The hand gives way where it touches the ground of the well.
    gripper = draft.attach(draft.attach(link, DOWN, "Suspension"), DOWN, "Grabber")
    return one_part(
        draft,
        "crane",
        "A wide foot, a post of 7, an arm of 8 with a counterweight, a gripper",
        overall="An arm on a high post that turns over the top, with a long hand that hangs.",
        control=keyed(
            "Down the well, half a turn over the top, let go, and lift the hand.",
            [
                (shoulder, "turn_left", _LEFT),
                (shoulder, "turn_right", _RIGHT),
                (gripper, "release", "Alpha1"),
            ],
            [
                (begin, _RIGHT, 0.38),
                *((round(begin + 2 + at, 2), _LEFT, round(hold, 3)) for at, hold in _OVER_THE_TOP),
                (begin + 16.0, "Alpha1", 0.2),
                (begin + 17.0, _RIGHT, 0.5),
            ],
        ),
    )


DESIGNS: Final[Designs] = {
    "deliver-2": courier,
    "drive-4": track_follower,
    "fetch-1": well_crane,
}
