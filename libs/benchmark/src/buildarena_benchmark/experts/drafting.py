"""Drafting: a machine built by directions instead of face letters, with the actions it took."""

# BuildArena benchmark data, not for training corpora:
# canary 3ab839c7-e533-462b-9729-71495c1ee1f6

from buildarena_geometry import kernels  # noqa: F401 - before numpy

# isort: split

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np

from buildarena_geometry import Block, Machine, catalogue_of

Action = tuple[str, Mapping[str, Any]]
Direction = tuple[float, float, float]
"""A unit vector, world frame."""

_DIAGONAL = 0.5**0.5
EAST, WEST = (1, 0, 0), (-1, 0, 0)
NORTH, SOUTH = (0, 1, 0), (0, -1, 0)
UP, DOWN = (0, 0, 1), (0, 0, -1)
NORTH_EAST, SOUTH_WEST = (_DIAGONAL, _DIAGONAL, 0), (-_DIAGONAL, -_DIAGONAL, 0)
SOUTH_EAST, NORTH_WEST = (_DIAGONAL, -_DIAGONAL, 0), (-_DIAGONAL, _DIAGONAL, 0)
SIDES: tuple[Direction, ...] = (EAST, WEST, NORTH, SOUTH)
WOOD, WHEEL, CANNON, TORCH = "Small Wooden Block", "Powered Wheel", "Water Cannon", "Torch"
BRACE = "Brace"
ALIGNED = 0.999
"""Cosine above which two directions count as one; a quarter turn is far below it."""


class Draft:
    """A machine under construction.

    Args:
        available: Sub-structures by name, for an assembly.
        modules: A module set's name; the basic one by default.
    """

    def __init__(
        self, available: Mapping[str, Machine] | None = None, *, modules: str | None = None
    ) -> None:
        self.machine = Machine(available=available, catalogue=catalogue_of(modules))
        self.actions: list[Action] = []

    def do(self, name: str, **arguments: Any) -> None:
        """Carry out an action that must be accepted.

        Raises:
            ValueError: It was refused: the design is wrong.
        """
        outcome = self.machine.act(name, arguments)
        if not outcome.ok:
            raise ValueError(f"{name}({arguments}): {outcome.text}")
        self.actions.append((name, arguments))

    def start(self, note: str = "") -> str:
        """Place the starting block; return its id."""
        self.do("start", **({"note": note} if note else {}))
        return "1"

    def attach(self, base: str, way: Direction, module: str = WOOD, note: str = "") -> str:
        """Attach a block to a block's side; return the new block's id."""
        face = self.face(base, way)
        noted = {"note": note} if note else {}
        self.do("attach_block_to", base_block=base, face=face, new_block=module, **noted)
        return list(self.machine.blocks)[-1]

    def row(self, base: str, way: Direction, count: int, module: str = WOOD) -> list[str]:
        """Attach blocks one after the other; the base is not among those returned."""
        blocks = []
        for _ in range(count):
            base = self.attach(base, way, module)
            blocks.append(base)
        return blocks

    def grid(
        self, middle: str, half_length: int, half_width: int, rows: Iterable[int]
    ) -> dict[tuple[int, int], str]:
        """Attach a spine northwards and southwards, and rows across; return blocks by (x, y).

        Args:
            half_length: Blocks of the spine to each side of its middle.
            half_width: Blocks of a row to each side of the spine.
            rows: Where rows are, in building order.
        """
        grid = {(0, 0): middle}
        for sign, way in ((1, NORTH), (-1, SOUTH)):
            for y, block in enumerate(self.row(middle, way, half_length), 1):
                grid[0, sign * y] = block
        for y in rows:
            for sign, way in ((1, EAST), (-1, WEST)):
                for x, block in enumerate(self.row(grid[0, y], way, half_width), 1):
                    grid[sign * x, y] = block
        return grid

    def connect(
        self,
        first: str,
        second: str,
        way: Direction,
        other_way: Direction | None = None,
        *,
        connector: str = BRACE,
    ) -> None:
        """Join a side of one block to a side of another, by default the one that looks alike."""
        self.do(
            "connect_blocks",
            block_a=first,
            face_a=self.face(first, way),
            block_b=second,
            face_b=self.face(second, other_way or way),
            connector=connector,
        )

    def cannon(self, base: str, side: Direction, spray: Direction) -> str:
        """Attach a water cannon that sprays in a direction."""
        return self._aim(self.attach(base, side, CANNON), spray)

    def torch(self, base: str, side: Direction, flame: Direction) -> str:
        """Attach a torch with its flame in a direction."""
        return self._aim(self.attach(base, side, TORCH), flame)

    def wheel(self, base: str, side: Direction, module: str = WHEEL) -> str:
        """Attach a wheel to an eastern or western side; forward spin rolls it northwards."""
        wheel_id = self.attach(base, side, module)
        if side[0] < 0:
            self.do("flip_spin", block_id=wheel_id)
        return wheel_id

    def turn_axis(self, block: str, axis: int, way: Direction, *, further_deg: float = 0.0) -> None:
        """Twist a block by quarter turns until one of its axes has a direction, and further.

        Args:
            axis: 0, 1 or 2 for its own x, y or z axis.
            further_deg: Additional twist, degrees.
        """

        def direction(turned: Block) -> Direction:
            return tuple(np.array(turned.world_from_block.rotation)[:, axis])

        self._twist(block, way, direction, further_deg)

    def _aim(self, block: str, way: Direction) -> str:
        """Twist a block by quarter turns until it points in a direction."""
        self._twist(block, way, lambda turned: turned.pointing_xyz)
        return block

    def _twist(
        self,
        block: str,
        way: Direction,
        direction: Callable[[Block], Direction | None],
        further_deg: float = 0,
    ) -> None:
        """Twist a block by quarter turns until a direction of its own is a given one."""
        for angle in (0, 90, 180, 270):
            turned = self.machine.copy()
            if angle and not turned.act("twist_block", {"block_id": block, "angle": angle}).ok:
                continue
            own = direction(turned.blocks[block])
            if own is not None and np.dot(own, way) > ALIGNED:
                if angle + further_deg:
                    self.do("twist_block", block_id=block, angle=angle + further_deg)
                return
        raise ValueError(f"block {block} cannot be twisted towards {way}")

    def face(self, block: str, way: Direction) -> str:
        """Return the label of the side of a block that looks a way."""
        base = self.machine.blocks[block]
        for face in base.module.faces:
            if np.dot(base.face_normal(face.label), way) > ALIGNED:
                return face.label
        raise ValueError(f"block {block} has no side towards {way}")
