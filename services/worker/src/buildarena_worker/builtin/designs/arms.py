"""Arms that take hold of a cargo: one that swings it over a wall."""

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


def swinging_arm(seed: int) -> Design:
    """An arm that turns over the top of a post; its gripper hangs from a swivel and stays upright."""
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
