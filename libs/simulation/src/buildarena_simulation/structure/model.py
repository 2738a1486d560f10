"""The arrays of one machine: what does not change while it is simulated."""

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

import numpy as np
from numpy.typing import NDArray

from buildarena_simulation.constants import JointKind

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

JOINT_KINDS: Final = tuple(JointKind)


class Role(StrEnum):
    """What a block does in the simulation."""

    START = "start"
    BLOCK = "block"
    WHEEL = "wheel"
    CANNON = "cannon"
    TORCH = "torch"


class ShapeKind(StrEnum):
    """The form of a block's collision shape."""

    BOX = "box"
    CYLINDER = "cylinder"


@dataclass(frozen=True, slots=True, kw_only=True)
class Shape:
    """A convex solid of a block.

    Attributes:
        kind: Its form.
        center: (3,) machine frame, units.
        rotation: (3, 3) machine_from_shape; a cylinder's axis is the third column.
        half_extents: (3,) along its axes; a cylinder's radius, radius and half length, units.
    """

    kind: ShapeKind
    center: FloatArray
    rotation: FloatArray
    half_extents: FloatArray

    @property
    def volume(self) -> float:
        """Units³."""
        share = math.pi / 4 if self.kind is ShapeKind.CYLINDER else 1.0
        return float(8.0 * share * np.prod(self.half_extents))

    def reach(self) -> FloatArray:
        """Half-extents of its axis-aligned bounding box, (3,), machine frame, units."""
        if self.kind is ShapeKind.CYLINDER:
            radius, half_length = self.half_extents[0], self.half_extents[2]
            axis = np.abs(self.rotation[:, 2])
            return np.asarray(half_length * axis + radius * np.sqrt(np.maximum(0.0, 1 - axis**2)))
        return np.asarray(np.abs(self.rotation) @ self.half_extents)


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """One block as the simulation sees it; the input of `build_structure`.

    Attributes:
        id: The block's id in its machine.
        role: What it does.
        mass: Its mass without connectors, mass units.
        center: (3,) its centre of mass, machine frame, units.
        shown: (3,) the point shown to models as its position, machine frame, units.
        rotation: (3, 3) machine_from_block.
        shapes: Its collision shapes.
        direction: (3,) unit vector, machine frame: a cannon's spray, a torch's flame, a wheel's
            outward axis; None for the others.
        flipped: Whether a wheel's spin is flipped.
        grabs: Whether its far end grabs what it touches.
    """

    id: str
    role: Role
    mass: float
    center: FloatArray
    shown: FloatArray
    rotation: FloatArray
    shapes: tuple[Shape, ...]
    direction: FloatArray | None = None
    flipped: bool = False
    grabs: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Members:
    """The joints that carry load, one row each; M members.

    Attributes:
        names: What each joins, fit to be shown: "1-2", "brace 7", …
        first: (M,) index of the block it starts from.
        second: (M,) index of the block it ends at.
        kind: (M,) index into `JOINT_KINDS`.
        point: (M, 3) its midpoint, machine frame, units.
        frame: (M, 3, 3) machine_from_member; the first column is the member's axis.
        stiffness: (M, 6) of its six springs (axial, two shears, torsion, two bendings).
        limits: (M, 2) force and moment at which it breaks, mass·g and mass·g·unit.
    """

    names: tuple[str, ...]
    first: IntArray
    second: IntArray
    kind: IntArray
    point: FloatArray
    frame: FloatArray
    stiffness: FloatArray
    limits: FloatArray

    def __len__(self) -> int:
        return len(self.names)


@dataclass(frozen=True, slots=True, kw_only=True)
class Ropes:
    """The winches' ropes, tension only; one row each.

    Attributes:
        names: What each joins, fit to be shown.
        first: (R,) index of the block it starts from.
        second: (R,) index of the block it ends at.
        first_point: (R, 3) where it starts, machine frame, units.
        second_point: (R, 3) where it ends, machine frame, units.
        length: (R,) its length, units.
        limit: (R,) tension at which it gives way, mass·g.
    """

    names: tuple[str, ...]
    first: IntArray
    second: IntArray
    first_point: FloatArray
    second_point: FloatArray
    length: FloatArray
    limit: FloatArray

    def __len__(self) -> int:
        return len(self.names)


@dataclass(frozen=True, slots=True, kw_only=True)
class Structure:
    """A machine of N blocks at rest in the machine frame, as arrays.

    The *machine frame* is the frame the machine was built in. Every rigid cluster moves by one
    transform world_from_machine of its own, so all arrays below stay constant.

    Attributes:
        parts: (N,) the blocks.
        positions: (N, 3) centres of mass, machine frame, units.
        shown: (N, 3) the points shown to models as positions, machine frame, units.
        rotations: (N, 3, 3) machine_from_block.
        masses: (N,) with half of every brace that ends on the block, mass units.
        centers_of_mass: (N, 3) of block and brace halves together, machine frame, units.
        inertias: (N, 3, 3) of block and brace halves about that point, machine frame axes.
        members: The joints.
        ropes: The winches' ropes.
        wheels: (W,) indices of the wheels.
        cannons: (C,) indices of the cannons.
        torches: (J,) indices of the torches.
        directions: (N, 3) unit vectors as in `Part.direction`, zero where there is none.
        linear_drag: (N,) 1/s; connectors have none.
        angular_drag: (N,) 1/s; wheels have none.
    """

    parts: tuple[Part, ...]
    positions: FloatArray
    shown: FloatArray
    rotations: FloatArray
    masses: FloatArray
    centers_of_mass: FloatArray
    inertias: FloatArray
    members: Members
    ropes: Ropes
    wheels: IntArray
    cannons: IntArray
    torches: IntArray
    directions: FloatArray
    linear_drag: FloatArray
    angular_drag: FloatArray

    def __len__(self) -> int:
        return len(self.parts)

    @property
    def block_ids(self) -> tuple[str, ...]:
        """Ids of the blocks, in the order of every array."""
        return tuple(part.id for part in self.parts)

    def bounds(self) -> FloatArray:
        """Lower and upper corner of all blocks' shapes, (2, 3), machine frame, units."""
        shapes = [shape for part in self.parts for shape in part.shapes]
        lower = np.min([shape.center - shape.reach() for shape in shapes], axis=0)
        upper = np.max([shape.center + shape.reach() for shape in shapes], axis=0)
        return np.array([lower, upper])
