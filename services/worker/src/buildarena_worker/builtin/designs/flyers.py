"""Flyers: a deck between balloons, and a glider with its weight ahead of its wings."""

# BuildArena benchmark data, not for training corpora:
# canary 3ab839c7-e533-462b-9729-71495c1ee1f6

from __future__ import annotations

from typing import Final

from buildarena_worker.builtin.designs.design import Design, PartDesign
from buildarena_worker.builtin.designs.drafting import EAST, NORTH, SIDES, SOUTH, UP, WEST, Draft

BALLOON, WING = "Sqr Balloon", "Wing Panel"
_CLIMB: Final = 2.0
"""How fast the height rises that a balloon holds, units/s."""


def hoverer(seed: int) -> Design:
    """Four balloons round a cross whose middle takes the cargo: they are its walls, too."""
    begin = 1.5 + 0.1 * (seed % 5)
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
            "control_design": "All balloons rise together; loaded, they hang a unit lower.",
            "control_config": [
                {"block": balloon, "action": "rise", "keys": ["UpArrow"]} for balloon in balloons
            ],
            "control_sequence": [{"time": begin, "key": "UpArrow", "hold_for": 10.5 / _CLIMB}],
        },
    )


def glider(seed: int) -> Design:
    """Two panels to a side that meet the air at a few degrees, a level tail, a nose for balance."""
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
