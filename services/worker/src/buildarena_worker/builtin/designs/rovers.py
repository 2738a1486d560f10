"""Vehicles of the workshop: one on sprung wheels, one that steers."""

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

_HALF_WIDTH, _HALF_LENGTH, _TRAY = 2, 3, 2


def rough_rider(seed: int) -> Design:
    """A tray on four large wheels, each on a spring leg of its own."""
    begin = 1.0 + 0.1 * (seed % 5)
    draft = Draft(modules="workshop")
    middle = draft.start("under the cargo")
    deck = {(0, 0): middle}
    for sign, way in ((1, NORTH), (-1, SOUTH)):
        for y, block in enumerate(draft.row(middle, way, _HALF_LENGTH), 1):
            deck[0, sign * y] = block
    for y in (*range(-_TRAY, _TRAY + 1), -_HALF_LENGTH, _HALF_LENGTH):
        for sign, way in ((1, EAST), (-1, WEST)):
            for x, block in enumerate(draft.row(deck[0, y], way, _HALF_WIDTH), 1):
                deck[sign * x, y] = block
    for (x, y), block in deck.items():
        if abs(y) <= _TRAY and (abs(x) == _HALF_WIDTH or abs(y) == _TRAY):
            draft.attach(block, UP, note="rail")
    wheels = []
    for y in (_HALF_LENGTH, -_HALF_LENGTH):
        for x, side in ((_HALF_WIDTH, EAST), (-_HALF_WIDTH, WEST)):
            leg = draft.attach(deck[x, y], DOWN, "Suspension")
            wheels.append(draft.wheel(leg, side, "Large Wheel"))
    return Design(
        overall="A railed tray on four large wheels, each sprung by itself.",
        parts={
            "rover": PartDesign(
                description="A tray of 5 x 5 with rails, a spring leg and a wheel at each corner",
                actions=tuple(draft.actions),
            )
        },
        control={
            "control_design": "All wheels drive north.",
            "control_config": [
                {"block": wheel, "action": "spinning_forward", "keys": ["UpArrow"]}
                for wheel in wheels
            ],
            "control_sequence": [{"time": begin, "key": "UpArrow", "hold_for": 8.0}],
        },
    )
