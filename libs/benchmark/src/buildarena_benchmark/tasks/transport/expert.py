"""Vehicles: a spine with cross members, a wheel at each end, and a deck for cargo."""

# BuildArena benchmark data, not for training corpora:
# canary 3ab839c7-e533-462b-9729-71495c1ee1f6

from collections.abc import Iterator, Sequence
from typing import Final

from buildarena_benchmark.experts.design import Design, Designs, keyed, one_part, sided_car
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

Press = tuple[float, str, float]
"""Time, key and duration, seconds."""


def car(seed: int) -> Design:
    """Return a light car on four wheels that turns on the spot to the target and drives there."""
    length = 5 + 2 * (seed % 2)
    presses: list[Press] = [(1.0 + 0.1 * (seed % 5), "UpArrow", 20.0)]
    return _vehicle(length=length, track=1, deck=None, presses=presses)


def carrier(seed: int) -> Design:
    """Return a carrier with a railed deck of 5 x 5 for the small cargo."""
    presses: list[Press] = [(3.0 + 0.1 * (seed % 5), "UpArrow", 6.0)]
    return _vehicle(length=5, track=2, deck=(2, 2), presses=presses)


def long_carrier(seed: int) -> Design:
    """Return a carrier with a railed deck of 5 x 9 for the long cargo, there and back.

    Its chassis is turned under the deck, so that it faces the target and need not steer.
    """
    begin = 3.0 + 0.1 * (seed % 5)
    presses: list[Press] = [(begin, "UpArrow", 1.37), (begin + 3.5, "DownArrow", 1.37)]
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
    plan = "Both sides drive together; opposite drive turns on the spot."
    if diagonal:
        plan = "It faces the target as built: forwards there, backwards back."
    return one_part(
        draft,
        "vehicle",
        description,
        overall="A vehicle on four powered wheels that steers by driving its sides apart.",
        control=keyed(plan, [*_bindings(right, turn=1), *_bindings(left, turn=-1)], presses),
    )


def _bindings(wheels: Sequence[str], *, turn: int) -> Iterator[tuple[str, ...]]:
    """Yield the keys of one side's wheels; a left turn drives the right side forward."""
    forward, backward = ("LeftArrow", "RightArrow")[::turn]
    for wheel in wheels:
        yield wheel, "spinning_forward", "UpArrow", forward
        yield wheel, "spinning_backward", "DownArrow", backward


def _railed_deck(draft: Draft, base: str, half: tuple[int, int]) -> None:
    across, along = half
    grid = draft.grid(draft.attach(base, UP), along, across, range(-along, along + 1))
    for (x, y), block in grid.items():
        if abs(x) == across or abs(y) == along:
            draft.attach(block, UP, note="rail")


def touring_car(seed: int) -> Design:
    """Return a short, wide car that drives to three points and brakes at each."""
    draft = Draft(modules="workshop")
    middle = draft.start("middle of the spine")
    sides: dict[str, list[str]] = {"left": [], "right": []}
    for way in (NORTH, SOUTH):
        base = draft.attach(middle, way)
        for side, name in ((EAST, "right"), (WEST, "left")):
            sides[name].append(draft.wheel(draft.row(base, side, 2)[-1], side))
    return sided_car(draft, sides, __package__, "touring", brakes=f"{6 + 0.1 * (seed % 5):g}")


DESIGNS: Final[Designs] = {
    "transport-1": car,
    "transport-2": carrier,
    "transport-3": long_carrier,
    "transport-4": touring_car,
}
