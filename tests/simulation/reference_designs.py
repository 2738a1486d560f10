"""Reference machines of our own design: one function per family, each yielding an action log.

A log is a list of ``{"op": action, "params": arguments}``. Every design is parametric, so that tests
vary it, and good ones can serve as a scripted expert's repertoire.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from buildarena_geometry import Machine

Actions = list[dict[str, Any]]
Direction = tuple[int, int, int]

EAST, WEST = (1, 0, 0), (-1, 0, 0)
NORTH, SOUTH = (0, 1, 0), (0, -1, 0)
UP, DOWN = (0, 0, 1), (0, 0, -1)
WOOD, WHEEL, CANNON, TORCH = "Small Wooden Block", "Powered Wheel", "Water Cannon", "Torch"
BRACE, WINCH = "Brace", "Winch"


class Draft:
    """A machine being drafted by directions instead of face labels, with the log it leaves."""

    def __init__(self, available: dict[str, Machine] | None = None) -> None:
        self.machine = Machine(available=available) if available else Machine()
        self.actions: Actions = []

    def do(self, op: str, **params: Any) -> None:
        outcome = self.machine.act(op, params)
        if not outcome.ok:
            raise ValueError(f"{op} {params}: {outcome.text}")
        self.actions.append({"op": op, "params": params})

    def start(self) -> str:
        self.do("start")
        return "1"

    def face(self, block: str, direction: Direction) -> str:
        """The face of a block that looks a way."""
        wanted = np.array(direction, dtype=float)
        found = self.machine.blocks[block]
        for face in found.module.faces:
            if found.world_from_face(face.label).rotation[:, 2] @ wanted > 0.999:
                return face.label
        raise ValueError(f"block {block} has no face towards {direction}")

    def attach(self, base: str, direction: Direction, module: str = WOOD) -> str:
        self.do(
            "attach_block_to",
            base_block=base,
            face=self.face(base, direction),
            new_block=module,
        )
        return list(self.machine.blocks)[-1]

    def row(self, base: str, direction: Direction, count: int) -> list[str]:
        """Blocks one after the other from a base on; the base is not among them."""
        made = []
        for _ in range(count):
            base = self.attach(base, direction)
            made.append(base)
        return made

    def connect(
        self, first: str, second: str, direction: Direction, *, connector: str = BRACE
    ) -> None:
        """A connector between the faces of two blocks that look the same way."""
        self.link(first, direction, second, direction, connector=connector)

    def link(
        self,
        first: str,
        way: Direction,
        second: str,
        other_way: Direction,
        *,
        connector: str = BRACE,
    ) -> None:
        self.do(
            "connect_blocks",
            block_a=first,
            face_a=self.face(first, way),
            block_b=second,
            face_b=self.face(second, other_way),
            connector=connector,
        )

    def bind(self, block: str, action: str, key: str) -> None:
        self.do("add_control_key", block_id=block, action=action, new_key=key)

    def press(self, key: str, time: float, hold_for: float) -> None:
        self.do("add_control_sequence", time=time, key=key, hold_for=hold_for)


# Bridges


def beam(length: int = 7, braces: str = "", direction: Direction = NORTH) -> Actions:
    """A single row of blocks.

    Args:
        length: Odd number of blocks.
        braces: Which braces: "t" every seam on top, "b" below, "T" and "B" one from end to end,
            "1" and "2" overlapping ones of length 4 on top and below.
        direction: Where it runs.
    """
    draft = Draft()
    middle = draft.start()
    back = tuple(-d for d in direction)
    ahead = draft.row(middle, direction, length // 2)
    behind = draft.row(middle, back, length // 2)  # type: ignore[arg-type]
    row = [*reversed(behind), middle, *ahead]
    for kind in braces:
        way = UP if kind in "tT1" else DOWN
        reach = {"t": 1, "b": 1, "1": 4, "2": 4}.get(kind, length - 1)
        for first, second in zip(row, row[reach:], strict=False):
            draft.connect(first, second, way)
    return draft.actions


def deck(
    width: int = 5,
    length: int = 7,
    *,
    cross: bool = False,
    along: str = "",
    rails: bool = False,
    pillars: int = 0,
) -> Actions:
    """A deck of rows along north-south that hang on one row along east-west.

    Args:
        width: Odd number of rows.
        length: Odd number of blocks per row.
        cross: Whether every east-west seam is braced on top.
        along: Braces along the rows, as in `beam`.
        rails: Whether three blocks stand at the middle of each long side.
        pillars: Height of two pillars below the blocks next to the middle.
    """
    draft = Draft()
    middle = draft.start()
    grid = {(0, 0): middle}
    for sign, way in ((1, EAST), (-1, WEST)):
        for x, block in enumerate(draft.row(middle, way, width // 2), 1):
            grid[sign * x, 0] = block
    for x in range(-(width // 2), width // 2 + 1):
        for sign, way in ((1, NORTH), (-1, SOUTH)):
            for y, block in enumerate(draft.row(grid[x, 0], way, length // 2), 1):
                grid[x, sign * y] = block
    xs = range(-(width // 2), width // 2 + 1)
    ys = range(-(length // 2), length // 2 + 1)
    if rails:
        for x in (xs[0], xs[-1]):
            for y in (-1, 0, 1):
                draft.attach(grid[x, y], UP)
    for y in (1, -1) if pillars else ():
        draft.row(grid[0, y], DOWN, pillars)
    if cross:
        edge = {xs[0], xs[-1]} if rails else set()
        for y in ys:
            for x in xs[:-1]:
                railed = abs(y) <= 1 and ({x, x + 1} & edge)
                draft.connect(grid[x, y], grid[x + 1, y], UP) if not railed else draft.connect(
                    grid[x, y], grid[x + 1, y], UP
                )
    for kind in along:
        way = UP if kind in "tT1" else DOWN
        reach = {"t": 1, "b": 1, "1": 4, "2": 4}.get(kind, length - 1)
        for x in xs:
            for y in ys[: len(ys) - reach]:
                draft.connect(grid[x, y], grid[x, y + reach], way)
    return draft.actions


def one_shot_bridge() -> Actions:
    """The bridge of the paper's one-shot example, which is reported to carry 1000."""
    return deck(5, 7, cross=True, rails=True, pillars=5)


def replayed(
    actions: Sequence[dict[str, Any]], available: dict[str, Machine] | None = None
) -> Machine:
    """The machine an action log builds; every action must be accepted."""
    machine = Machine(available=available) if available else Machine()
    for action in actions:
        outcome = machine.act(action["op"], action["params"])
        if not outcome.ok:
            raise ValueError(f"{action}: {outcome.text}")
    return machine
