"""Arms that take hold of a cargo: one swings it over a wall, one lifts it by gears."""

# BuildArena benchmark data, not for training corpora:
# canary 3ab839c7-e533-462b-9729-71495c1ee1f6

from __future__ import annotations

from buildarena_worker.builtin.designs.design import Design, PartDesign
from buildarena_worker.builtin.designs.drafting import (
    DOWN,
    EAST,
    NORTH,
    SOUTH,
    UP,
    WEST,
    Draft,
)

_LIFTS_S = (18.5, 18.2, 17.9, 17.6)
"""When the lift begins, by seed, seconds."""

_OVER_THE_TOP = (*((0.16 * k, 0.08) for k in range(12)), (1.92, 3.76))
"""When the crane turns and for how long, seconds: at half its pace to begin with, so that the arm
keeps up with its drive and does not catch up by a jerk."""

_MOTORS = 4
_LIGHT_S = 0.8
"""When a cargo that grows heavier is still light enough for three motors, seconds."""


def swinging_arm(seed: int) -> Design:
    """An arm that turns over the top of a post; its gripper hangs from a swivel, upright."""
    begin = 1.0 + 0.1 * (seed % 5)
    draft = Draft(modules="workshop")
    middle = draft.start("under the post")
    for side in (EAST, WEST):
        draft.row(middle, side, 4)
    back = draft.row(middle, SOUTH, 3)[-1]
    for side in (EAST, WEST):
        draft.row(back, side, 3)
    draft.row(middle, NORTH, 1)
    shoulder = draft.attach(draft.row(middle, UP, 3)[-1], NORTH, "Steering Block")
    hand = draft.row(draft.attach(shoulder, NORTH), WEST, 4)[-1]
    link = draft.attach(draft.attach(hand, NORTH, "Swivel"), DOWN)
    gripper = draft.attach(link, DOWN, "Grabber")
    return Design(
        overall="An arm that turns over the top of a post, with a gripper that hangs.",
        parts={
            "arm": PartDesign(
                description="A wide foot, a post of 3, an arm of 4 with a hanging gripper",
                actions=tuple(draft.actions),
            )
        },
        control={
            "control_design": "Half a turn over the wall, let go, and lift the hand off.",
            "control_config": [
                {"block": shoulder, "action": "turn_left", "keys": ["LeftArrow"]},
                {"block": shoulder, "action": "turn_right", "keys": ["RightArrow"]},
                {"block": gripper, "action": "release", "keys": ["Alpha1"]},
            ],
            "control_sequence": [
                {"time": begin, "key": "LeftArrow", "hold_for": 3.96},
                {"time": begin + 8.0, "key": "Alpha1", "hold_for": 0.2},
                {"time": begin + 9.0, "key": "RightArrow", "hold_for": 0.5},
            ],
        },
    )


def well_crane(seed: int) -> Design:
    """A high arm with a counterweight; its long hand goes down a well, and over the top with it."""
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
    for near in draft.row(root, EAST, 5)[2:]:
        for way in (NORTH, SOUTH, UP, DOWN):
            draft.attach(near, way, "Log", note="counterweight")
    # A block further out than the arm is wide: what hangs there passes it at the top.
    hand = draft.attach(draft.attach(arm[-1], NORTH), NORTH, "Swivel")
    link = draft.row(hand, DOWN, 2)[-1]
    # The hand gives way where it touches the ground of the well.
    gripper = draft.attach(draft.attach(link, DOWN, "Suspension"), DOWN, "Grabber")
    return Design(
        overall="An arm on a high post that turns over the top, with a long hand that hangs.",
        parts={
            "crane": PartDesign(
                description="A wide foot, a post of 7, an arm of 8 with a counterweight, a gripper",
                actions=tuple(draft.actions),
            )
        },
        control={
            "control_design": "Down the well, half a turn over the top, let go, and lift the hand.",
            "control_config": [
                {"block": shoulder, "action": "turn_left", "keys": ["LeftArrow"]},
                {"block": shoulder, "action": "turn_right", "keys": ["RightArrow"]},
                {"block": gripper, "action": "release", "keys": ["Alpha1"]},
            ],
            "control_sequence": [
                {"time": begin, "key": "RightArrow", "hold_for": 0.38},
                *(
                    {"time": round(begin + 2.0 + at, 2), "key": "LeftArrow", "hold_for": hold_for}
                    for at, hold_for in _OVER_THE_TOP
                ),
                {"time": begin + 16.0, "key": "Alpha1", "hold_for": 0.2},
                {"time": begin + 17.0, "key": "RightArrow", "hold_for": 0.5},
            ],
        },
    )


def geared_lift(seed: int) -> Design:
    """An arm on a large gear wheel that four powered ones drive, with a counterweight."""
    return _geared_lift(_LIFTS_S[seed % len(_LIFTS_S)], lasts=1.2)


def loaded_lift(seed: int) -> Design:
    """The same machine with three of its motors: all four jerk, and a light cargo slips off."""
    return _geared_lift(_LIGHT_S + 0.04 * (seed % 4), lasts=1.3, driven=3)


def _geared_lift(begin: float, *, lasts: float, driven: int = _MOTORS) -> Design:
    """A geared arm with a counterweight.

    Args:
        begin: When it begins to lift, seconds.
        lasts: For how long it does, seconds.
        driven: How many of its motors do.
    """
    named = "All four motors" if driven == _MOTORS else f"{driven} of the motors"
    draft = Draft(modules="workshop")
    beams, hub, post = _trestle(draft)
    wheel = draft.attach(hub, EAST, "Cog Large Unpowered")
    motors = [draft.attach(base, EAST, "Cog Medium Powered") for base in post]
    root = draft.attach(wheel, EAST)
    hand = draft.attach(draft.row(root, NORTH, 6)[-1], EAST, "Swivel")
    draft.attach(draft.row(hand, DOWN, 3)[-1], DOWN, "Grabber")
    # A unit longer, the weights would brush the ground while the arm rises.
    near = draft.row(root, SOUTH, 3)[-1]
    for way in (EAST, UP, DOWN):
        draft.attach(near, way, "Log", note="counterweight")
    draft.attach(draft.attach(near, SOUTH), EAST, "Log", note="counterweight")
    _brace(draft, beams, post)
    return Design(
        overall="A trestle with a geared arm: four motors on one large wheel, a counterweight.",
        parts={
            "lift": PartDesign(
                description="Two beams on the ground, a post of 8, an arm of 6 on a large wheel",
                actions=tuple(draft.actions),
            )
        },
        control={
            "control_design": f"{named} lift together, and brake when the key is let go.",
            "control_config": [
                {"block": motor, "action": "spinning_forward", "keys": ["UpArrow"]}
                for motor in motors[:driven]
            ],
            "control_sequence": [{"time": begin, "key": "UpArrow", "hold_for": lasts}],
        },
    )


_Beams = dict[str, list[str]]


def _trestle(draft: Draft) -> tuple[_Beams, str, list[str]]:
    """Beams on both sides of the cargo, and a post with seats for a wheel and its motors.

    Returns:
        The beams by name, the block of the large wheel, and those of the motors.
    """
    middle = draft.start("between the beams")
    beams = {"west": draft.row(middle, WEST, 3)}
    foot, east = beams["west"][-1], draft.row(middle, EAST, 2)[-1]
    beams["near"] = draft.row(foot, NORTH, 8)
    beams["far"] = draft.row(east, NORTH, 8)
    beams["back"] = draft.row(foot, SOUTH, 4)
    beams["post"] = draft.row(foot, UP, 8)
    hub = beams["post"][4]
    ahead, behind = draft.row(hub, NORTH, 3)[-1], draft.row(hub, SOUTH, 3)[-1]
    return beams, hub, [beams["post"][1], beams["post"][7], ahead, behind]


def _brace(draft: Draft, beams: _Beams, post: list[str]) -> None:
    """Braces from the motors' seats to beams and top, across the beams, and about the foot."""
    _, top, ahead, behind = post
    west, near = beams["west"], beams["near"]
    draft.connect(ahead, near[5], NORTH, UP)
    draft.connect(behind, beams["back"][3], SOUTH, UP)
    draft.connect(top, ahead, NORTH, UP)
    draft.connect(top, behind, SOUTH, UP)
    for k in (7, 5, 3):
        draft.connect(near[k], beams["far"][k], EAST, WEST)
    draft.connect(west[0], beams["post"][0], UP, EAST)
    draft.connect(west[0], west[2], SOUTH, DOWN)
    draft.connect(west[1], west[2], NORTH, DOWN)
    draft.connect(west[0], near[1], NORTH, EAST)
