"""Vehicles of the workshop: one on sprung wheels, one that steers."""

# BuildArena benchmark data, not for training corpora:
# canary 3ab839c7-e533-462b-9729-71495c1ee1f6

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

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

Press = tuple[float, str, float]
"""Time, key and duration, seconds."""

_SAMPLE_S = 0.04
_HALF_WIDTH, _HALF_LENGTH, _TRAY = 2, 3, 2
_LEFT, _RIGHT, _AHEAD, _BACK = "LeftArrow", "RightArrow", "UpArrow", "DownArrow"
_SLALOM = (
    (2.73, _RIGHT, 0.16),
    (3.48, _LEFT, 0.38),
    (5.3, _RIGHT, 0.13),
    (5.64, _RIGHT, 0.31),
    (7.46, _LEFT, 0.21),
    (8.84, _RIGHT, 0.1),
)
"""When which way the slalom's car steers and for how long, seconds. It lets the third gate be: from
the second to the fourth it goes straight. Found by search on both engines; it passes the other four
within 1.2 of their middles."""
_WAVE_S = 0.36
_WAVE = (
    *(3, -2, -2, -3, 0, 0, 5, 5, 5, -3, -7, -10, -7, 2, 8, 11, 10, 6, -5, -11, -13, -11, -6, 6),
    *(11, 14, 12, 9, -2, -10, -13, -13, -13, -7, 6, 12, 12, 13, 17, 6, -7, -12, -15, -10, -15),
    *(-13, 4, 11, 11, 10, 13, 17, 5, -9, -12, -10, -9, -13, -18, 0, 10, 11, 8, 9, 13, 16, 3, -9),
    *(-14, -17, -17, -7, 7, 19, 19, 4, -13, -16, -6, 9, 10, 2),
)
"""For how long the car of the long slalom steers at equal intervals, hundredths of a second, to the
right above 0. Found by steering the car on both engines at once, towards the middle between where
each of them had it."""
_TOUR = (
    (0.4, _AHEAD, 2.0),
    (0.56, _RIGHT, 0.04),
    (2.2, _LEFT, 0.05),
    (3.68, _AHEAD, 1.76),
    (3.84, _RIGHT, 0.07),
    (6.76, _BACK, 1.34),
    (6.92, _LEFT, 0.12),
    (7.32, _LEFT, 0.03),
    (7.76, _LEFT, 0.03),
)
"""When the car of the three stops presses which key and for how long, seconds; found likewise."""

_PAST_THE_CONE = (
    (0.4, _AHEAD, 19.0),
    (1.68, _RIGHT, 0.28),
    (2.44, _LEFT, 0.8),
    (3.12, _RIGHT, 0.32),
)
_TRACK = (
    (0.4, _AHEAD, 19.0),
    (1.72, _RIGHT, 0.32),
    (3.24, _LEFT, 0.24),
    (4.04, _LEFT, 0.48),
    (5.76, _RIGHT, 0.48),
)
"""When the car that bends presses which key and for how long, seconds; both found by search."""


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


def slalom_car(seed: int) -> Design:
    """A long car that steers with all wheels and backs off first, for a run-up."""
    return _steering_car(
        [(0.2, _BACK, 1.2), (1.75, _AHEAD, 12.0), *_SLALOM],
        begin=0.04 * (seed % 4),
        plan="Back off, then drive through and steer from gate to gate.",
    )


def long_slalom_car(seed: int) -> Design:
    """The same car, steered in a wave that grows, a little every time."""
    steps = [
        (math.ceil((0.7 + _WAVE_S * k) / _SAMPLE_S) * _SAMPLE_S, _RIGHT if way > 0 else _LEFT, way)
        for k, way in enumerate(_WAVE)
        if way
    ]
    return _steering_car(
        [(0.3, _AHEAD, 29.0), *((time, key, abs(way) / 100) for time, key, way in steps)],
        begin=_SAMPLE_S * (seed % 4),
        plan="Drive through, and steer in a wave that grows.",
    )


def touring_car(seed: int) -> Design:
    """The same car, ahead to two points and back to a third."""
    return _steering_car(
        _TOUR,
        begin=_SAMPLE_S * (seed % 4),
        plan="Ahead to the first point, ahead to the second, back to the third.",
    )


def cone_passer(seed: int) -> Design:
    """A car that bends: through the gap, then past the cone on its right side."""
    return _bending_car(_PAST_THE_CONE, begin=2 * _SAMPLE_S * (seed % 4), plan="Round the cone.")


def track_follower(seed: int) -> Design:
    """The same car, steered through two bends."""
    return _bending_car(_TRACK, begin=2 * _SAMPLE_S * (seed % 4), plan="Right, straight on, left.")


def _bending_car(presses: Sequence[Press], *, begin: float, plan: str) -> Design:
    """A car as narrow as its wheels that bends in its middle; arguments as `_steering_car`."""
    draft = Draft(modules="workshop")
    middle = draft.start("behind the joint")
    joint = draft.attach(middle, NORTH, "Steering Hinge")
    draft.turn_axis(joint, 0, UP)
    front, back = draft.attach(joint, NORTH), draft.row(middle, SOUTH, 2)[-1]
    wheels = [draft.wheel(base, side) for base in (front, back) for side in (EAST, WEST)]
    config = [
        {"block": joint, "action": "turn_left", "keys": [_LEFT]},
        {"block": joint, "action": "turn_right", "keys": [_RIGHT]},
    ]
    for wheel in wheels:
        config += [
            {"block": wheel, "action": "spinning_forward", "keys": [_AHEAD]},
            {"block": wheel, "action": "spinning_backward", "keys": [_BACK]},
        ]
    return Design(
        overall="A narrow car on four wheels that bends in its middle.",
        parts={
            "car": PartDesign(
                description="Two axles of two wheels each, and a steering hinge between them",
                actions=tuple(draft.actions),
            )
        },
        control={
            "control_design": plan,
            "control_config": config,
            "control_sequence": [
                {"time": round(begin + time, 2), "key": key, "hold_for": hold}
                for time, key, hold in presses
            ],
        },
    )


def _steering_car(presses: Sequence[Press], *, begin: float, plan: str) -> Design:
    """A long car whose four wheels all steer.

    Args:
        presses: Time, key and duration of each, seconds.
        begin: How much later all of them are, seconds.
        plan: What they are for.
    """
    draft = Draft(modules="workshop")
    middle = draft.start("between the axles")
    front, back = (draft.row(middle, way, _HALF_LENGTH)[-1] for way in (NORTH, SOUTH))
    config: list[dict[str, Any]] = []
    for base, keys in ((front, (_LEFT, _RIGHT)), (back, (_RIGHT, _LEFT))):
        for side in (EAST, WEST):
            hinge = draft.attach(base, side, "Steering Hinge")
            draft.turn_axis(hinge, 0, UP)
            wheel = draft.wheel(hinge, side)
            config += [
                {"block": wheel, "action": "spinning_forward", "keys": [_AHEAD]},
                {"block": wheel, "action": "spinning_backward", "keys": [_BACK]},
                {"block": hinge, "action": "turn_left", "keys": [keys[0]]},
                {"block": hinge, "action": "turn_right", "keys": [keys[1]]},
            ]
    return Design(
        overall="A long car whose four wheels all steer, the rear ones against the front ones.",
        parts={
            "car": PartDesign(
                description="A beam of 7 blocks, a steering hinge and a wheel at each corner",
                actions=tuple(draft.actions),
            )
        },
        control={
            "control_design": plan,
            "control_config": config,
            "control_sequence": [
                {"time": round(begin + time, 2), "key": key, "hold_for": hold}
                for time, key, hold in presses
            ],
        },
    )
