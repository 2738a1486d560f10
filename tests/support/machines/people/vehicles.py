"""Vehicles: cars and carriers of two to eight wheels, with and without rails."""

from collections.abc import Sequence

from support.machines.drafts import KeyedDraft

from buildarena_geometry import Machine
from buildarena_worker.builtin.designs.drafting import EAST, NORTH, SOUTH, UP, WEST

Drive = Sequence[tuple[str, float, float]]
"""Key, time and duration of each press, seconds."""


def car(
    axles: int = 2,
    *,
    length: int = 5,
    track: int = 1,
    drive: Drive = (("UpArrow", 1.0, 4.0),),
    tray: tuple[int, int] | None = None,
    trike: bool = False,
) -> Machine:
    """A spine with an axle of two wheels at even distances, which steers like a tank.

    Args:
        axles: How many, 1 to 4; one axle is in the middle.
        length: Odd number of blocks in the spine.
        track: Blocks between the spine and a wheel.
        drive: What is pressed.
        tray: Half-width and half-length of a railed tray above the spine; None for none.
        trike: Whether the last axle is a single wheel at the side of the spine.
    """
    draft = KeyedDraft()
    middle = draft.start()
    half = length // 2
    spine = [
        *reversed(draft.row(middle, SOUTH, half)),
        middle,
        *draft.row(middle, NORTH, half),
    ]
    apart = (length - 1) / max(axles - 1, 1)
    places = [round(k * apart) for k in range(axles)] if axles > 1 else [half]
    wheels = []
    for number, place in enumerate(places):
        if trike and number == 0:
            wheels.append((draft.wheel(spine[place], EAST), EAST))
            continue
        for side in (EAST, WEST):
            end = [spine[place], *draft.row(spine[place], side, track)][-1]
            wheels.append((draft.wheel(end, side), side))
    for wheel, side in wheels:
        turns = ("LeftArrow", "RightArrow") if side == EAST else ("RightArrow", "LeftArrow")
        for keys in (("UpArrow", "DownArrow"), turns):
            for action, key in zip(("forward", "backward"), keys, strict=True):
                draft.bind(wheel, f"spinning_{action}", key)
    if tray is not None:
        _tray(draft, middle, *tray)
    for key, time, hold_for in drive:
        draft.press(key, time, hold_for)
    return draft.machine


def _tray(draft: KeyedDraft, base: str, across: int, along: int) -> None:
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
