"""Vehicles: cars with and without decks, stools, carts."""

from collections.abc import Sequence

from tests.simulation.designs.draft import (
    DOWN,
    EAST,
    NORTH,
    SOUTH,
    UP,
    WEST,
    WHEEL,
    Actions,
    Draft,
)


def car(
    length: int = 5,
    track: int = 1,
    *,
    axles: int = 2,
    deck_half: tuple[int, int] | None = None,
    rails: bool = True,
    bound: bool = True,
    drive: Sequence[tuple[str, float, float]] = (("UpArrow", 1.0, 20.0),),
) -> Actions:
    """A spine along north-south with cross members, a wheel at each of their ends.

    UpArrow and DownArrow drive it, LeftArrow and RightArrow turn it on the spot.

    Args:
        length: Odd number of blocks in the spine.
        track: Blocks between the spine and a wheel.
        axles: Number of cross members, 2 or 3.
        deck_half: Half-width and half-length of a deck above it, in blocks; None for no deck.
        rails: Whether a rail runs round the deck.
        bound: Whether keys are bound to the wheels.
        drive: Key, time and duration of each press.
    """
    draft = Draft()
    middle = draft.start()
    front = draft.row(middle, NORTH, length // 2)[-1]
    back = draft.row(middle, SOUTH, length // 2)[-1]
    right, left = [], []
    for base in (front, back, middle)[:axles]:
        for side, wheels in ((EAST, right), (WEST, left)):
            end = ([base, *draft.row(base, side, track)])[-1]
            wheels.append(draft.wheel(end, side))
    if deck_half is not None:
        _deck_on(draft, middle, deck_half, rails=rails)
    if bound:
        for wheels, turn in ((right, "LeftArrow"), (left, "RightArrow")):
            back_turn = "RightArrow" if turn == "LeftArrow" else "LeftArrow"
            for wheel in wheels:
                draft.bind(wheel, "spinning_forward", "UpArrow")
                draft.bind(wheel, "spinning_backward", "DownArrow")
                draft.bind(wheel, "spinning_forward", turn)
                draft.bind(wheel, "spinning_backward", back_turn)
        for key, time, hold_for in drive:
            draft.press(key, time, hold_for)
    return draft.actions


def _deck_on(draft: Draft, base: str, half: tuple[int, int], *, rails: bool) -> None:
    across, along = half
    grid = {(0, 0): draft.attach(base, UP)}
    for sign, way in ((1, NORTH), (-1, SOUTH)):
        for y, block in enumerate(draft.row(grid[0, 0], way, along), 1):
            grid[0, sign * y] = block
    for y in range(-along, along + 1):
        for sign, way in ((1, EAST), (-1, WEST)):
            for x, block in enumerate(draft.row(grid[0, y], way, across), 1):
                grid[sign * x, y] = block
    if rails:
        for (x, y), block in grid.items():
            if abs(x) == across or abs(y) == along:
                draft.attach(block, UP)


def stool(height: int = 3) -> Actions:
    """A block with wheels lying flat on top: nothing that turns touches the ground."""
    draft = Draft()
    middle = draft.start()
    arms = [draft.row(middle, way, 2)[-1] for way in (EAST, WEST, NORTH, SOUTH)]
    for arm in arms:
        draft.row(arm, DOWN, height)
        wheel = draft.attach(arm, UP, WHEEL)
        draft.bind(wheel, "spinning_forward", "UpArrow")
    draft.press("UpArrow", 1.0, 20.0)
    return draft.actions


def cart() -> Actions:
    """Two driven wheels beside the starting block and a tail that drags on the ground."""
    draft = Draft()
    middle = draft.start()
    for side in (EAST, WEST):
        draft.bind(draft.wheel(middle, side), "spinning_forward", "UpArrow")
    draft.row(middle, SOUTH, 3)
    draft.press("UpArrow", 1.0, 20.0)
    return draft.actions
