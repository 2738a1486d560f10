"""The parts a machine is made of."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from buildarena_geometry.modules.module import Module
from buildarena_geometry.poses import Pose
from buildarena_geometry.rotations import Vector, add, scaled
from buildarena_geometry.struct_reader import Amount, Form, Positive

FaceRef = tuple[str, str]  # block id, face label

JOINT_REACH = 0.5  # units; Besiege joins two sides that were moved apart by this much and no more


@dataclass(frozen=True, slots=True, kw_only=True)
class _Part:
    """Common base of blocks and connectors.

    Attributes:
        id: "1", "2", … in the order of creation, or "A_3" in an assembly; never used twice.
        bindings: the keys bound to each of its actions.
        structure: letter of its sub-structure in an assembly; "" elsewhere. A connector is of its
            start's.
        note: the builder's own words about it.
    """

    id: str
    module: Module
    bindings: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    structure: str = ""
    note: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Block(_Part):
    """A block of a machine; connectors are not blocks.

    Attributes:
        world_from_block: pose of its root point; +z points away from the face it sits on.
        mount: the face it sits on; None for a starting block and for one whose base was removed.
        lost_mount: the face it sat on before that block was removed.
        flipped: true if a wheel's spin is reversed.
    """

    world_from_block: Pose
    mount: FaceRef | None = None
    lost_mount: FaceRef | None = None
    flipped: bool = False

    @property
    def mass(self) -> float:
        """Mass units."""
        return self.module.mass

    @property
    def center_xyz(self) -> Vector:
        """The position shown to models, world frame, units."""
        return self.world_from_block.point(self.module.center)

    @property
    def body_center_xyz(self) -> Vector:
        """The middle of its body, as of a wheel's disc, world frame, units."""
        body = self.module.body
        return self.world_from_block.point(body[0].center) if body else self.center_xyz

    @property
    def pointing_xyz(self) -> Vector | None:
        """The way a cannon or torch points, world frame, unit length; None for the others."""
        if self.module.pointing is None:
            return None
        return self.world_from_block.direction(self.module.pointing)

    @property
    def axis_xyz(self) -> Vector:
        """Away from the face the block sits on, world frame, unit length; a wheel's axle."""
        return self.world_from_block.direction((0.0, 0.0, 1.0))

    @property
    def seat_xyz(self) -> Vector:
        """Center of the face it sits on, where the two touch, world frame, units."""
        if not self.module.root_offset:
            return self.world_from_block.xyz
        return self.world_from_block.point((0.0, 0.0, -self.module.root_offset))

    @property
    def forward_is_clockwise(self) -> bool:
        """True if it turns clockwise, seen from outside, when it runs forward."""
        sense = self.module.spin_sense
        return sense is not None and (sense == "clockwise") != self.flipped

    def world_from_face(self, label: str) -> Pose:
        """Return the frame of one of its faces: origin at the face's centre, +z outwards.

        Raises:
            KeyError: the block's module has no such face.
        """
        return self.world_from_block @ self.module.face_of_label[label].block_from_face

    def face_center(self, label: str) -> Vector:
        """Return the centre of one of its faces, world frame, units."""
        return self.world_from_block.point(self.module.face_of_label[label].center)

    def face_normal(self, label: str) -> Vector:
        """Return the outward normal of one of its faces, world frame, unit length."""
        return self.world_from_block.direction(self.module.face_of_label[label].normal)

    def landmark(self, along: float) -> Vector:
        """Return the point `along` units from its centre in the pointing direction, world frame."""
        towards = self.pointing_xyz
        return self.center_xyz if towards is None else add(self.center_xyz, scaled(towards, along))


@dataclass(frozen=True, slots=True, kw_only=True)
class Connector(_Part):
    """A brace or winch between two faces.

    Attributes:
        start_xyz: the present centre of the start face, world frame, units.
        end_xyz: the present centre of the end face, world frame, units.
        world_from_connector: its own frame, that of a block attached to the start face when it was
            made. Later twists and shifts of the connector turn and move this frame, not the ends.
        span: (3,) from start to end in that frame, when the connector was made or last moved as
            part of a sub-structure.
    """

    start: FaceRef
    end: FaceRef
    start_xyz: Vector
    end_xyz: Vector
    world_from_connector: Pose
    span: Vector

    @property
    def mass(self) -> float:
        """Mass units."""
        length = math.dist(self.start_xyz, self.end_xyz) if self.module.strut else 0.0
        return self.module.mass * max(length, 1.0)

    @property
    def ends(self) -> tuple[str, str]:
        """Ids of the blocks that it begins and ends on."""
        return (self.start[0], self.end[0])


@dataclass(frozen=True, slots=True, kw_only=True)
class Joint:
    """Attachment of a block to a face.

    Attributes:
        base: id of the block it sits on.
        part: id of the block that sits.
        face: label of the base's face.
        part_xyz: where it acts: where the part touches that face when flush, world frame, units.
        base_xyz: the face's centre, world frame, units.
        offset: distance by which these two points were moved apart since they were joined, units.
    """

    base: str
    part: str
    face: str
    part_xyz: Vector
    base_xyz: Vector
    offset: float

    @property
    def holds(self) -> bool:
        """True if Besiege would still form it."""
        # Shifts add up in floating point: an exact half must not fail by rounding.
        return self.offset <= JOINT_REACH + 1e-9


class KeyPress(Form, frozen=True, kw_only=True):
    """An entry of a control sequence: from `time_s` on, `key` is held for `hold_for_s` seconds."""

    time_s: Amount
    key: str
    hold_for_s: Positive


def seated(world_from_face: Pose, module: Module) -> Pose:
    """Return the pose of a new block on a face."""
    if not module.root_offset:
        return world_from_face
    return world_from_face @ Pose(position=(0.0, 0.0, module.root_offset))
