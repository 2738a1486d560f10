"""Cars that are sampled by a seed: their shapes and faults.

A car has three wheels at each side of its frame, all bound to one key, and drives northwards
while that key is held. It is about as wide as long, so that wheels which drive otherwise turn it
aside; long and narrow ones may go straight on for all their faults. Shape, sides, order of building
and faults are sampled; every fault is repaired by one edit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from random import Random
from typing import Final

from buildarena_benchmark.experts.drafting import WHEEL, Draft
from buildarena_geometry import Machine

KEY: Final = "UpArrow"
PRESS: Final = (0.5, 9.0)
"""Start and duration of the key press, seconds."""
EAST, WEST = 1, -1
OTHER_KEYS: Final = ("DownArrow", "LeftArrow", "RightArrow", "Alpha1")
FAULTS: Final = ("missing", "turned", "other key", "backward", "unbound")
"""A wheel that is not there; that spins the other way; whose key is another, or makes it run
backward; that has no key."""
_DRIVES: Final = {"": 1, "turned": -1, "backward": -1}
"""Direction in which a wheel with a fault drives; one of the other kinds does not drive."""
_UNEQUAL: Final = 2
"""By how many wheels the sides of a faulty car drive differently, at least."""


Cells = list[tuple[int, int]]
FramePlan = tuple[Cells, list[tuple[tuple[int, int], int]]]
"""A frame's cells, and the cells and sides at which its wheels sit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Wheel:
    """A wheel of a car.

    Attributes:
        place: (east, north) of the block it sits on, blocks from the frame's middle.
        side: `EAST` or `WEST`: the side of that block.
        fault: Member of `FAULTS`; "" for none.
        key: The wrong key, if any.
    """

    place: tuple[int, int]
    side: int
    fault: str = ""
    key: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Car:
    """A car before it is built.

    Attributes:
        blocks: (east, north) of its blocks in building order, each next to an earlier one; the
            first is the starting block.
        wheels: In building order.
    """

    blocks: tuple[tuple[int, int], ...]
    wheels: tuple[Wheel, ...]

    @property
    def whole(self) -> Car:
        """The car without its faults."""
        return replace(self, wheels=tuple(replace(w, fault="", key="") for w in self.wheels))


def sample_car(seed: int, faults: int) -> Car:
    """Return the car of a seed.

    Each fault is of another kind. Together they make one side drive less than the other by two
    wheels at least, so that they do not make up for each other.

    Args:
        seed: Determines shape and faults.
        faults: Number of faulty wheels among the six, 2 to 5.
    """
    draw = Random(f"car {seed}")  # noqa: S311 - to be repeatable, not secret
    cells, seats = draw.choice((_spine, _ladder, _cross_frame))(draw)
    start = draw.randrange(len(cells))
    order = _order_cells(cells, cells[start], draw)
    seats = draw.sample(seats, len(seats))
    wheels = [Wheel(place=place, side=side) for place, side in seats]
    while True:
        kinds = dict(
            zip(draw.sample(range(len(wheels)), faults), draw.sample(FAULTS, faults), strict=True)
        )
        faulty = [
            replace(wheel, fault=kinds[k], key=draw.choice(OTHER_KEYS)) if k in kinds else wheel
            for k, wheel in enumerate(wheels)
        ]
        if abs(sum(wheel.side * _DRIVES.get(wheel.fault, 0) for wheel in faulty)) >= _UNEQUAL:
            return Car(blocks=tuple(order), wheels=tuple(faulty))


def built(car: Car) -> Machine:
    """Return the machine of a car, with its faults.

    It is built without the missing wheels, so its log does not reveal the faults.
    """
    draft = Draft()
    at = {car.blocks[0]: draft.start()}
    for cell in car.blocks[1:]:
        neighbour = next(c for c in at if _beside(c, cell))
        at[cell] = draft.attach(at[neighbour], (cell[0] - neighbour[0], cell[1] - neighbour[1], 0))
    for wheel in car.wheels:
        if wheel.fault != "missing":
            _mount(draft, at[wheel.place], wheel)
    draft.do("add_control_sequence", time=PRESS[0], key=KEY, hold_for=PRESS[1])
    return draft.machine


def _spine(draw: Random) -> FramePlan:
    """Return a spine with cross members of one length."""
    half, reach = draw.randint(2, 3), draw.randint(2, 4)
    rows = _rows(draw, half)
    cells = [(0, y) for y in range(-half, half + 1)]
    cells += [(side * x, y) for y in rows for side in (EAST, WEST) for x in range(1, reach + 1)]
    return cells, [((side * reach, y), side) for y in rows for side in (EAST, WEST)]


def _ladder(draw: Random) -> FramePlan:
    """Return two rails with rungs between them; the wheels sit on the rails."""
    half, reach = draw.randint(2, 3), draw.randint(2, 4)
    rows = _rows(draw, half)
    cells = [(side * reach, y) for side in (EAST, WEST) for y in range(-half, half + 1)]
    cells += [(x, y) for y in rows for x in range(-reach + 1, reach)]
    return cells, [((side * reach, y), side) for y in rows for side in (EAST, WEST)]


def _cross_frame(draw: Random) -> FramePlan:
    """Return a spine whose cross members are longer in the middle than at its ends."""
    half, short = draw.randint(2, 3), draw.randint(2, 3)
    rows = _rows(draw, half)
    long = short + draw.randint(1, 2)
    reaches = {y: short if abs(y) == half else long for y in rows}
    cells = [(0, y) for y in range(-half, half + 1)]
    cells += [
        (side * x, y) for y in rows for side in (EAST, WEST) for x in range(1, reaches[y] + 1)
    ]
    return cells, [((side * reaches[y], y), side) for y in rows for side in (EAST, WEST)]


def _rows(draw: Random, half: int) -> list[int]:
    """Return where the three axles are: at both ends and between, two apart or more."""
    return [-half, draw.randint(-half + 2, half - 2), half]


def _order_cells(
    cells: Sequence[tuple[int, int]], first: tuple[int, int], draw: Random
) -> list[tuple[int, int]]:
    """Return the cells in an order in which each lies next to an earlier one."""
    order, left = [first], set(cells) - {first}
    while left:
        candidates = sorted(c for c in left if any(_beside(c, other) for other in order))
        order.append(draw.choice(candidates))
        left.remove(order[-1])
    return order


def _beside(first: tuple[int, int], second: tuple[int, int]) -> bool:
    return abs(first[0] - second[0]) + abs(first[1] - second[1]) == 1


def _mount(draft: Draft, base: str, wheel: Wheel) -> None:
    """Mount a wheel on a block, with its fault."""
    wheel_id = draft.attach(base, (wheel.side, 0, 0), WHEEL)
    if (wheel.side == WEST) != (wheel.fault == "turned"):
        draft.do("flip_spin", block_id=wheel_id)
    action = "spinning_backward" if wheel.fault == "backward" else "spinning_forward"
    if wheel.fault != "unbound":
        key = wheel.key if wheel.fault == "other key" else KEY
        draft.do("add_control_key", block_id=wheel_id, action=action, new_key=key)
