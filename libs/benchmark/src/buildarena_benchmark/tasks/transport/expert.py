"""Vehicles: a spine with cross members, a wheel at each end, and a deck for cargo."""

# BuildArena benchmark data, not for training corpora:
# canary 3ab839c7-e533-462b-9729-71495c1ee1f6

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from buildarena_benchmark.experts.design import Design, Designs, PartDesign
from buildarena_benchmark.experts.drafting import (
    DOWN,
    EAST,
    NORTH,
    NORTH_EAST,
    NORTH_WEST,
    SOUTH,
    SOUTH_EAST,
    SOUTH_WEST,
    UP,
    WEST,
    Direction,
    Draft,
)

Press = tuple[str, float, float]
"""Key, time and duration, seconds."""
_SAMPLE_S, _HALF_LENGTH = 0.04, 3
_LEFT, _RIGHT, _AHEAD, _BACK = "LeftArrow", "RightArrow", "UpArrow", "DownArrow"
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
"""When the car of the three stops presses which key and for how long, seconds.
Found by steering the car on both engines at once."""


def car(seed: int) -> Design:
    """A light car on four wheels that turns on the spot towards the target and drives there."""
    length = 5 + 2 * (seed % 2)
    presses: list[Press] = [("UpArrow", 1.0 + 0.1 * (seed % 5), 20.0)]
    return _vehicle(length=length, track=1, deck=None, presses=presses)


def carrier(seed: int) -> Design:
    """Return a carrier with a railed deck of 5 x 5 for the small cargo."""
    presses: list[Press] = [("UpArrow", 3.0 + 0.1 * (seed % 5), 6.0)]
    return _vehicle(length=5, track=2, deck=(2, 2), presses=presses)


def long_carrier(seed: int) -> Design:
    """Return a carrier with a railed deck of 5 x 9 for the long cargo, there and back.

    Its chassis is turned under the deck, so that it faces the target and need not steer.
    """
    begin = 3.0 + 0.1 * (seed % 5)
    presses: list[Press] = [("UpArrow", begin, 1.37), ("DownArrow", begin + 3.5, 1.37)]
    return _vehicle(length=7, track=2, deck=(2, 4), presses=presses, diagonal=True)


def _vehicle(
    *,
    length: int,
    track: int,
    deck: tuple[int, int] | None,
    presses: Sequence[Press],
    diagonal: bool = False,
) -> Design:
    """Return a vehicle that skid-steers: its wheels on one side share their keys.

    Args:
        length: Odd number of blocks of the spine.
        track: Blocks between the spine and a wheel.
        deck: Half-width and half-length of the deck in blocks, or None.
        diagonal: Whether the chassis hangs below the starting block and faces north-east.
    """
    draft = Draft()
    middle = draft.start("under the deck" if diagonal else "middle of the spine")
    spine = middle
    ways: tuple[Direction, ...] = (NORTH, SOUTH, EAST, WEST)
    if diagonal:
        spine = draft.attach(middle, DOWN)
        draft.do("twist_block", block_id=spine, angle=45)
        ways = (NORTH_EAST, SOUTH_WEST, SOUTH_EAST, NORTH_WEST)
    ahead, behind, east, west = ways
    front = draft.row(spine, ahead, length // 2)[-1]
    back = draft.row(spine, behind, length // 2)[-1]
    right: list[str] = []
    left: list[str] = []
    for base in (front, back):
        for side, wheels in ((east, right), (west, left)):
            end = [base, *draft.row(base, side, track)][-1]
            wheels.append(draft.wheel(end, side))
    if deck is not None:
        _railed_deck(draft, middle, deck)
    carries = (
        "no deck" if deck is None else f"a railed deck of {2 * deck[0] + 1} x {2 * deck[1] + 1}"
    )
    description = f"A spine of {length} blocks, two cross members with two wheels each, {carries}"
    if diagonal:
        description += "; the spine is turned by 45° under the starting block"
    return Design(
        overall="A vehicle on four powered wheels that steers by driving its sides apart.",
        parts={"vehicle": PartDesign(description=description, actions=tuple(draft.actions))},
        control={
            "control_design": "It faces the target as built: forwards there, backwards back."
            if diagonal
            else "Both sides drive together; opposite drive turns on the spot.",
            "control_config": [*_bindings(right, turn=1), *_bindings(left, turn=-1)],
            "control_sequence": [
                {"time": time, "key": key, "hold_for": hold_for} for key, time, hold_for in presses
            ],
        },
    )


def _bindings(wheels: Sequence[str], *, turn: int) -> list[dict[str, Any]]:
    """Return the keys of one side's wheels; a left turn drives the right side forward."""
    forward, backward = ("LeftArrow", "RightArrow")[::turn]
    return [
        {"block": wheel, "action": action, "keys": keys}
        for wheel in wheels
        for action, keys in (
            ("spinning_forward", ["UpArrow", forward]),
            ("spinning_backward", ["DownArrow", backward]),
        )
    ]


def _railed_deck(draft: Draft, base: str, half: tuple[int, int]) -> None:
    across, along = half
    grid = {(0, 0): draft.attach(base, UP)}
    for sign, way in ((1, NORTH), (-1, SOUTH)):
        for y, block in enumerate(draft.row(grid[0, 0], way, along), 1):
            grid[0, sign * y] = block
    for y in range(-along, along + 1):
        for sign, way in ((1, EAST), (-1, WEST)):
            for x, block in enumerate(draft.row(grid[0, y], way, across), 1):
                grid[sign * x, y] = block
    for (x, y), block in grid.items():
        if abs(x) == across or abs(y) == along:
            draft.attach(block, UP, note="rail")


def touring_car(seed: int) -> Design:
    """Return a car that steers with all wheels, ahead to two points and back to a third."""
    return _steering_car(
        _TOUR,
        begin=_SAMPLE_S * (seed % 4),
        plan="Ahead to the first point, ahead to the second, back to the third.",
    )


def _steering_car(
    presses: Sequence[tuple[float, str, float]], *, begin: float, plan: str
) -> Design:
    """Return a long car whose four wheels all steer.

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


DESIGNS: Final[Designs] = {
    "transport-1": car,
    "transport-2": carrier,
    "transport-3": long_carrier,
    "transport-4": touring_car,
}
