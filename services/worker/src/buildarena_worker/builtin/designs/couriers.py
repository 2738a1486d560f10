"""Vehicles that keep a ball between two prongs and push it."""

# BuildArena benchmark data, not for training corpora:
# canary 3ab839c7-e533-462b-9729-71495c1ee1f6

from __future__ import annotations

from buildarena_worker.builtin.designs.design import Design, PartDesign
from buildarena_worker.builtin.designs.drafting import EAST, NORTH, SOUTH, WEST, Draft

_PRONG = 2
"""Length of a prong, blocks: longer ones strike a ramp that bends upwards."""
_BEGINS_S = (0.4, 0.48, 0.56, 0.64, 0.72)
"""When it drives off, by seed, seconds."""


def courier(seed: int) -> Design:
    """A car of four wheels with a fork in front, as wide as the ball and a little more."""
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
    return Design(
        overall="A car that pushes the ball ahead, between two prongs.",
        parts={
            "courier": PartDesign(
                description="A spine of 5, two cross members of 5, four wheels, two prongs of 2",
                actions=tuple(draft.actions),
            )
        },
        control={
            "control_design": "All wheels drive north until the trial ends.",
            "control_config": [
                {"block": wheel, "action": "spinning_forward", "keys": ["UpArrow"]}
                for wheel in wheels
            ],
            "control_sequence": [
                {"time": _BEGINS_S[seed % len(_BEGINS_S)], "key": "UpArrow", "hold_for": 19.0}
            ],
        },
    )
