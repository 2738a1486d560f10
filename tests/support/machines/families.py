"""Families of plain machines, good and bad ones: the expert's designs are good only.

Tests vary their parameters, and random machines are drawn from them. A machine that has no
parameters is kept as data: see `references`.
"""

from collections.abc import Sequence

from support.machines.building import KeyedDraft

from buildarena_benchmark.experts.drafting import (
    DOWN,
    EAST,
    NORTH,
    SIDES,
    SOUTH,
    UP,
    WEST,
    Direction,
    Draft,
)
from buildarena_geometry import Machine

REACH = {"t": 1, "b": 1, "1": 4, "2": 4}
"""Blocks that a brace spans, by its kind; the other kinds span all."""
Grid = dict[tuple[int, int], str]


def beam(length: int = 7, braces: str = "", direction: Direction = NORTH) -> Machine:
    """A single row of blocks.

    Args:
        length: Odd number of blocks.
        braces: Which braces: "t" every seam on top, "b" below, "T" and "B" one from end to end,
            "1" and "2" overlapping ones of length 4 on top and below.
        direction: Where it runs.
    """
    draft = Draft()
    middle = draft.start()
    x, y, z = direction
    ahead = draft.row(middle, direction, length // 2)
    behind = draft.row(middle, (-x, -y, -z), length // 2)
    row = [*reversed(behind), middle, *ahead]
    for kind in braces:
        for first, second in zip(row, row[REACH.get(kind, length - 1) :], strict=False):
            draft.connect(first, second, UP if kind in "tT1" else DOWN)
    return draft.machine


def deck(
    width: int = 5,
    length: int = 7,
    *,
    cross: bool = False,
    along: str = "",
    rails: bool = False,
    pillars: int = 0,
) -> Machine:
    """A deck of rows along north-south that hang on one row along east-west.

    Args:
        width: Odd number of rows.
        length: Odd number of blocks per row.
        cross: Whether every east-west seam is braced on top.
        along: Braces along the rows, as in `beam`.
        rails: Whether three blocks are on top at the middle of each long side.
        pillars: Height of the two pillars below the deck; 0 for none.
    """
    draft = Draft()
    grid = _deck_grid(draft, width // 2, length // 2)
    if rails:
        for x in (-(width // 2), width // 2):
            for y in (-1, 0, 1):
                draft.attach(grid[x, y], UP)
    for place in ((0, 1), (0, -1)) if pillars else ():
        draft.row(grid[place], DOWN, pillars)
    if cross:
        _brace_grid(draft, grid, (1, 0), UP)
    for kind in along:
        way = UP if kind in "tT1" else DOWN
        _brace_grid(draft, grid, (0, REACH.get(kind, length - 1)), way)
    return draft.machine


def lattice(width: int, length: int, brace_count: int) -> Machine:
    """A plain deck with some of its east-west seams braced; for measurements of speed."""
    draft = Draft()
    grid = _deck_grid(draft, width // 2, length // 2)
    seams = [(x, y) for x, y in sorted(grid) if (x + 1, y) in grid]
    for x, y in seams[:: len(seams) // brace_count][:brace_count]:
        draft.connect(grid[x, y], grid[x + 1, y], DOWN)
    return draft.machine


def car(
    length: int = 5,
    track: int = 1,
    *,
    axles: int = 2,
    deck_half: tuple[int, int] | None = None,
    rails: bool = True,
    bound: bool = True,
    drive: Sequence[tuple[str, float, float]] = (("UpArrow", 1.0, 20.0),),
) -> Machine:
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
    draft = KeyedDraft()
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
        for wheels, turns in ((right, ("LeftArrow", "RightArrow")), (left, _TURNS_LEFT)):
            for wheel in wheels:
                for keys in (("UpArrow", "DownArrow"), turns):
                    for action, key in zip(("forward", "backward"), keys, strict=True):
                        draft.bind(wheel, f"spinning_{action}", key)
        for key, time, hold_for in drive:
            draft.press(key, time, hold_for)
    return draft.machine


_TURNS_LEFT = ("RightArrow", "LeftArrow")


def rocket(
    sides: Sequence[Direction] = SIDES,
    *,
    heated: bool = True,
    cargo_blocks: int = 0,
    skew: bool = False,
) -> Machine:
    """Cannons round the starting block that spray down, each with a torch two blocks below.

    Args:
        sides: On which sides of the starting block a cannon sits.
        heated: Whether there are torches.
        cargo_blocks: Blocks on top, as dead weight.
        skew: Whether three blocks hang out to the east, so that it tips.
    """
    draft = KeyedDraft()
    middle = draft.start()
    cannons = [draft.cannon(middle, side, DOWN) for side in sides]
    low = draft.row(middle, DOWN, 2)[-1]
    for side in sides if heated else ():
        draft.torch(low, side, UP)
    top = draft.row(middle, UP, max(cargo_blocks, 1 if skew else 0))
    if skew:
        draft.row(top[-1], EAST, 3)
    for cannon in cannons:
        draft.bind(cannon, "hold_to_fire", "Alpha1")
    return draft.machine


def rocket_parts(sides: Sequence[Direction] = SIDES, *, heated: bool = True) -> dict[str, Machine]:
    """An engine and a cross-shaped frame."""
    frame = Draft()
    middle = frame.start()
    for side in SIDES:
        frame.row(middle, side, 2)
    return {"engine": rocket(sides, heated=heated), "frame": frame.machine}


def rocket_assembly(sides: Sequence[Direction] = SIDES, *, heated: bool = True) -> Machine:
    """An engine under a cross-shaped frame, held together by four braces."""
    whole = Draft(rocket_parts(sides, heated=heated))
    whole.do("add_machine", machine_id="frame", init_shift=[0, 0, 2])
    whole.do("add_machine", machine_id="engine", init_shift=[0, 0, 0])
    for side in SIDES:
        whole.connect("A_1", "B_1", side, UP)
    return whole.machine


def mechanism() -> Machine:
    """Sixty parts with twenty joints: a chassis on six wheels and suspensions, with arms on it."""
    draft = KeyedDraft(modules="workshop")
    middle = draft.start()
    spine = [*reversed(draft.row(middle, SOUTH, 6)), middle, *draft.row(middle, NORTH, 6)]
    for k in (1, 6, 11):
        for side in (EAST, WEST):
            leg = draft.attach(draft.attach(spine[k], side), side, "Suspension")
            draft.bind(draft.attach(leg, side, "Powered Wheel"), "spinning_forward", "UpArrow")
    joints = ("Hinge", "Steering Hinge", "Swivel", "Ball Joint", "Slider", "Piston")
    for base, name in zip(spine[2:], (*joints, "Steering Block", "Spinning Block"), strict=False):
        joint = draft.attach(base, UP, name)
        draft.attach(joint, UP)
        if name.startswith("Steering"):
            draft.bind(joint, "turn_left", "LeftArrow")
    draft.row(spine[0], UP, 60 - len(draft.machine.blocks))
    draft.press("UpArrow", 0.5, 10.0)
    draft.press("LeftArrow", 1.0, 2.0)
    return draft.machine


def _deck_grid(draft: Draft, across: int, along: int) -> Grid:
    """Blocks of a deck by row and place, counted from the middle."""
    grid = {(0, 0): draft.start()}
    for sign, way in ((1, EAST), (-1, WEST)):
        for x, block in enumerate(draft.row(grid[0, 0], way, across), 1):
            grid[sign * x, 0] = block
    for x in range(-across, across + 1):
        for sign, way in ((1, NORTH), (-1, SOUTH)):
            for y, block in enumerate(draft.row(grid[x, 0], way, along), 1):
                grid[x, sign * y] = block
    return grid


def _brace_grid(draft: Draft, grid: Grid, step: tuple[int, int], way: Direction) -> None:
    """A brace from every block to the one a step further on."""
    for x, y in sorted(grid, key=lambda place: place[:: -1 if step[0] else 1]):
        further = grid.get((x + step[0], y + step[1]))
        if further is not None:
            draft.connect(grid[x, y], further, way)


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
