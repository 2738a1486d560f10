"""The arrays of one machine: what does not change while it is simulated."""

import math
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Final

import numpy as np
from numpy.typing import NDArray

from buildarena_geometry.modules.forces import Spring
from buildarena_geometry.modules.module import Module, Physics
from buildarena_simulation.constants import JointKind

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

JOINT_KINDS: Final = tuple(JointKind)


class ShapeKind(StrEnum):
    """The form of a block's collision shape."""

    BOX = "box"
    CYLINDER = "cylinder"
    SPHERE = "sphere"


_SHARE_OF_BOX: Final = {
    ShapeKind.BOX: 1.0,
    ShapeKind.CYLINDER: math.pi / 4,
    ShapeKind.SPHERE: math.pi / 6,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Shape:
    """A convex solid of a block.

    Attributes:
        center: (3,) machine frame, units.
        rotation: (3, 3) machine_from_shape; a cylinder's axis is the third column.
        half_extents: (3,) along its axes; a cylinder's radius, radius and half length;
            a sphere's radius three times; units.
    """

    kind: ShapeKind
    center: FloatArray
    rotation: FloatArray
    half_extents: FloatArray

    @property
    def volume(self) -> float:
        """Units³."""
        share = _SHARE_OF_BOX[self.kind]
        return float(8.0 * share * np.prod(self.half_extents))

    def reach(self) -> FloatArray:
        """Return the half-extents of its axis-aligned bounding box, (3,), machine frame, units."""
        if self.kind is ShapeKind.CYLINDER:
            radius, half_length = self.half_extents[0], self.half_extents[2]
            axis = np.abs(self.rotation[:, 2])
            return np.asarray(half_length * axis + radius * np.sqrt(np.maximum(0.0, 1 - axis**2)))
        if self.kind is ShapeKind.SPHERE:
            return self.half_extents
        return np.asarray(np.abs(self.rotation) @ self.half_extents)

    def turned(self, rotation: FloatArray) -> "Shape":
        """Return the shape of a machine turned about its origin by a rotation (3, 3)."""
        return replace(self, center=rotation @ self.center, rotation=rotation @ self.rotation)


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """A block in the simulation; input of `build_structure`.

    Attributes:
        id: The block's id in its machine.
        physics: Its properties as a body.
        center: (3,) its centre of mass, machine frame, units.
        shown: (3,) the point shown to models as its position, machine frame, units.
        rotation: (3, 3) machine_from_block.
        shapes: Its collision shapes.
        direction: (3,) unit vector, machine frame: a cannon's spray, a torch's flame, a wheel's
            outward axis; None for the others.
        axis: (3,) unit vector, machine frame: axis of its rotation or shift on its base; zero for
            fixed blocks.
        pivot: (3,) a point of that axis, machine frame, units.
        forward_is_clockwise: True if its motor turns it clockwise, seen from outside, when it runs
            forward.
    """

    id: str
    module: Module
    physics: Physics
    center: FloatArray
    shown: FloatArray
    rotation: FloatArray
    shapes: tuple[Shape, ...]
    direction: FloatArray | None = None
    forward_is_clockwise: bool = False
    axis: FloatArray = field(default_factory=lambda: np.zeros(3))
    pivot: FloatArray = field(default_factory=lambda: np.zeros(3))

    @property
    def mass(self) -> float:
        """Its mass without connectors, mass units."""
        return self.module.mass

    @property
    def is_wheel(self) -> bool:
        """True if it turns on an axle on the face it sits on."""
        return self.physics.joint_type == "axle"


@dataclass(frozen=True, slots=True, kw_only=True)
class Spheres:
    """Spheres that blocks carry along their directions, such as flames; K of them.

    Attributes:
        block: (K,) the block each belongs to.
        along: (K,) how far its centre lies from the block's shown centre in its direction, units.
        radius: (K,) units.
    """

    block: IntArray
    along: FloatArray
    radius: FloatArray

    def __len__(self) -> int:
        return len(self.block)

    def centers(self, shown: FloatArray, directions: FloatArray) -> FloatArray:
        """Return their centres, (K, 3), in the frame of the arguments, units.

        Args:
            shown: (N, 3) the points shown to models as the blocks' positions.
            directions: (N, 3) unit vectors as in `Part.direction`.
        """
        return np.asarray(shown[self.block] + self.along[:, None] * directions[self.block])


@dataclass(frozen=True, slots=True, kw_only=True)
class Members:
    """Joints that carry load, one row each; M members.

    Attributes:
        names: Names for messages: "1-2", "brace 7", …
        first: (M,) index of the block it starts from.
        second: (M,) index of the block it ends at.
        kind: (M,) index into `JOINT_KINDS`.
        point: (M, 3) its midpoint, machine frame, units.
        frame: (M, 3, 3) machine_from_member; the first column is the member's axis.
        stiffness: (M, 6) of its six springs (axial, two shears, torsion, two bendings).
        limits: (M, 2) force and moment at which it breaks alone, mass·g and mass·g·unit.
        buckling: (M,) pressing force at which it buckles, mass·g; infinite if it does not.
        share: (M,) share of its limits left by parallel connectors.
        ends: (S, 3) ends of connectors at faces that several connectors use: the member, the sign
            of its force on that end (-1 at its first block), and the face's number. Together they
            are no stronger than one of them.
    """

    names: tuple[str, ...]
    first: IntArray
    second: IntArray
    kind: IntArray
    point: FloatArray
    frame: FloatArray
    stiffness: FloatArray
    limits: FloatArray
    buckling: FloatArray
    share: FloatArray
    ends: IntArray

    def __len__(self) -> int:
        return len(self.names)


@dataclass(frozen=True, slots=True, kw_only=True)
class Ropes:
    """Ropes of winches, tension only, and springs; one row each.

    Attributes:
        names: Names for messages.
        first: (R,) index of the block it starts from.
        second: (R,) index of the block it ends at.
        first_point: (R, 3) start, machine frame, units.
        second_point: (R, 3) end, machine frame, units.
        length: (R,) length, units.
        limit: (R,) tension at which it breaks, mass·g.
        stiffness: (R,) of a spring, mass/s²; 0 of a rope.
        damping: (R,) of a spring, mass/s; 0 of a rope.
        spring_of: Data of each spring, in the order of `springs`.
    """

    names: tuple[str, ...]
    first: IntArray
    second: IntArray
    first_point: FloatArray
    second_point: FloatArray
    length: FloatArray
    limit: FloatArray
    stiffness: FloatArray
    damping: FloatArray
    spring_of: tuple[Spring, ...] = ()

    def __len__(self) -> int:
        return len(self.names)

    @property
    def springs(self) -> IntArray:
        """Rows that are springs."""
        return np.flatnonzero(self.stiffness)


@dataclass(frozen=True, slots=True, kw_only=True)
class Mesh:
    """Two cogs whose teeth engage.

    Attributes:
        first: Block index of one.
        second: Block index of the other.
        ratio: Speed of the second about its own axis over that of the first, both seen from what
            they are mounted on.
    """

    first: int
    second: int
    ratio: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Joints:
    """Joints between blocks and their bases.

    Attributes:
        axes: (N, 3) see `Part.axis`.
        points: (N, 3) see `Part.pivot`.
        simple: (N,) true for a block on an axle without limits, spring or a further drive, whose
            angle does not matter.
        driven: (D,) blocks that follow a target: the wheels, then other driven joints.
        meshes: The cogs that engage.
    """

    axes: FloatArray
    points: FloatArray
    simple: BoolArray
    driven: IntArray
    meshes: tuple[Mesh, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Structure:
    """A machine of N blocks at rest in the machine frame, as arrays.

    The *machine frame* is the frame the machine was built in. Every rigid cluster moves by its own
    transform world_from_machine, so all arrays below stay constant.

    Attributes:
        parts: (N,) the blocks.
        positions: (N, 3) centres of mass, machine frame, units.
        shown: (N, 3) the points shown to models as positions, machine frame, units.
        rotations: (N, 3, 3) machine_from_block.
        masses: (N,) with half of every brace that ends on the block, mass units.
        centers_of_mass: (N, 3) of block and brace halves together, machine frame, units.
        inertias: (N, 3, 3) of block and brace halves about that point, machine frame axes.
        joints: Joints between blocks and their bases.
        ropes: The winches' ropes.
        wheels: (W,) indices of the wheels.
        cannons: (C,) indices of the cannons.
        torches: (J,) indices of the torches.
        directions: (N, 3) unit vectors as in `Part.direction`, zero where there is none.
        torques: (N,) torque limit of each block's motor, mass·g·unit; 0 where there is none.
        thrust_points: (C, 3) point of each cannon's push, machine frame, units.
        cold_thrusts: (C,) push of each cannon without a flame, mass·g.
        heated_thrusts: (C,) push of each cannon that a flame touches, mass·g.
        heat_bodies: Bodies that heat a cannon when a flame touches them.
        flames: The torches' flames.
        linear_drag: (N,) 1/s; connectors have none.
        angular_drag: (N,) 1/s.
        hoses: The two blocks of each hose.
    """

    parts: tuple[Part, ...]
    positions: FloatArray
    shown: FloatArray
    rotations: FloatArray
    masses: FloatArray
    centers_of_mass: FloatArray
    inertias: FloatArray
    members: Members
    joints: Joints
    ropes: Ropes
    wheels: IntArray
    cannons: IntArray
    torches: IntArray
    directions: FloatArray
    torques: FloatArray
    thrust_points: FloatArray
    cold_thrusts: FloatArray
    heated_thrusts: FloatArray
    heat_bodies: Spheres
    flames: Spheres
    linear_drag: FloatArray
    angular_drag: FloatArray
    hoses: tuple[tuple[int, int], ...] = ()

    def __len__(self) -> int:
        return len(self.parts)

    @property
    def block_ids(self) -> tuple[str, ...]:
        """Ids of the blocks, in the order of every array."""
        return tuple(part.id for part in self.parts)

    def bounds(self, rotation: FloatArray | None = None) -> FloatArray:
        """Return the lower and upper corner of all blocks' shapes, (2, 3), machine frame, units.

        Args:
            rotation: (3, 3) by which the machine is turned about its origin first.
        """
        shapes = [shape for part in self.parts for shape in part.shapes]
        if rotation is not None:
            shapes = [shape.turned(rotation) for shape in shapes]
        lower = np.min([shape.center - shape.reach() for shape in shapes], axis=0)
        upper = np.max([shape.center + shape.reach() for shape in shapes], axis=0)
        return np.array([lower, upper])
