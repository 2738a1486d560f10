"""Modules, the parts of machines, with their faces and shapes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

from msgspec import field
from msgspec.structs import force_setattr

from buildarena_geometry.errors import CatalogueError
from buildarena_geometry.modules.forces import Forces
from buildarena_geometry.modules.joints import Gear, MovingJoint, Sense
from buildarena_geometry.modules.names import CaselessNames
from buildarena_geometry.modules.solids import Solid
from buildarena_geometry.poses import Pose
from buildarena_geometry.rotations import ORIGIN, Vector
from buildarena_geometry.struct_reader import (
    Amount,
    Finite,
    Form,
    Name,
    Point,
    Positive,
    Sourced,
    Whole,
    refuse,
)

Kind = Literal[
    "start", "block", "joint", "wheel", "flight", "cannon", "torch", "device", "connector", "cargo"
]
ATTACHABLE_KINDS = ("block", "joint", "wheel", "flight", "cannon", "torch", "device")
JointType = Literal[
    "attachment", "axle", "mount", "hinge", "slider", "ball", "constant_velocity", "loose"
]
Link = Literal["rigid", "rope", "spring", "hose"]
FLUSH_TOLERANCE = 1e-6  # units; faces nearer than this are the same place
_FACING = -0.9  # cosine; a face that looks this way looks at the block it sits on


@dataclass(frozen=True, slots=True, kw_only=True)
class Face:
    """A place of a module where others attach.

    Attributes:
        label: the letter models name it by.
        block_from_face: its frame in the block's: the origin is the face's centre, +z its outward
            normal; a block attached to it takes over this frame as its own.
    """

    label: str
    block_from_face: Pose

    @property
    def center(self) -> Vector:
        """(3,) the face's centre, block frame, units."""
        return self.block_from_face.xyz

    @property
    def normal(self) -> Vector:
        """(3,) the outward normal, block frame, unit length."""
        return self.block_from_face.direction((0.0, 0.0, 1.0))


class Landmark(Form, frozen=True, kw_only=True):
    """A point with a function, such as a cannon's outlet or a torch's flame.

    Attributes:
        along: distance from the block's centre in the pointing direction, units.
        radius: of the sphere around it, units; None for a mere point.
        heats: true if it is a flame, a sphere that heats objects in contact with it.
    """

    name: Name
    along: Finite
    radius: Positive | None = None
    heats: bool = False

    def __post_init__(self) -> None:
        """Refuse a flame without a radius."""
        if self.heats and self.radius is None:
            refuse("radius", "the radius of a flame, which is a sphere", self.radius)


class Sphere(Form, frozen=True, kw_only=True):
    """A sphere on the line through a block's centre in the pointing direction.

    Attributes:
        along: distance of its centre from the block's centre in the pointing direction, units.
        radius: units.
    """

    along: Finite
    radius: Positive


class Motor(Sourced, frozen=True, kw_only=True):
    """Motor that turns a wheel about its axle while a key is held; without a key it brakes.

    Attributes:
        speed_rpm: revolutions per minute.
        lag_per_s: rate of the first-order lag with which its target speed follows the keys, 1/s.
        torque: greatest torque, mass·g·unit.
        forward_sense: sense of forward, seen from outside against its axle, until its spin is
            flipped.
    """

    speed_rpm: Positive
    lag_per_s: Positive
    torque: Positive
    forward: str
    backward: str
    forward_sense: Sense

    @property
    def speed(self) -> float:
        """Angular speed, rad/s."""
        return self.speed_rpm * 2.0 * math.pi / 60.0


class Thrust(Sourced, frozen=True, kw_only=True):
    """Recoil of a cannon, against its pointing direction, while its key is held.

    Attributes:
        along: distance of the point of application from the block's centre in the pointing
            direction, units.
        cold: the push without a flame, mass·g.
        heated: the push while a flame touches one of the spheres, mass·g.
        spheres: spheres of the body, tested for contact with flames.
    """

    action: str
    along: Finite
    cold: Amount
    heated: Amount
    spheres: tuple[Sphere, ...]


class Physics(Sourced, frozen=True, kw_only=True):
    """A block's properties as a body, for every simulator.

    Attributes:
        joint_type: attachment to the face it sits on: an ordinary one, a mount that practically
            never breaks, a moving joint (axle, hinge, slider, ball, constant-velocity joint), or
            none: a loose block only lies there.
        mass_at: position of its mass: at its displayed position, or in the middle of its body.
        structural: true for a load-bearing part of the frame: a far end can grab it, and it can
            rest on ground and terrain.
        friction: coefficient of friction.
        linear_drag: share of its velocity it loses, 1/s.
        angular_drag: share of its spin it loses, 1/s.
    """

    joint_type: JointType
    mass_at: Literal["center", "body"]
    structural: bool
    friction: Amount
    linear_drag: Amount
    angular_drag: Amount


class BesiegeDatum(Form, frozen=True, kw_only=True):
    """A further entry of a block in Besiege's machine files."""

    type: str
    key: str
    value: str | int | float | bool


class BesiegeEntry(Form, frozen=True, kw_only=True):
    """Representation of a module in Besiege's machine files.

    Attributes:
        id: number of its block.
        data: further entries of the block.
        keys: the entry that holds the keys of an action, by the action.
    """

    id: Whole
    data: tuple[BesiegeDatum, ...]
    keys: dict[str, Name] = field(default_factory=dict)


class ModuleFields(Forces, frozen=True, kw_only=True):
    """Fields of both a module and its entry in a module file, except its forces.

    Attributes:
        name: name that models use.
        mass: mass units; a cargo's until its task sets another.
        size: (3,) its extent along x, y and z, units; None for connectors.
        center: (3,) the point shown to models as its position.
        colliders: the convex solids that may not overlap another block's; smaller than the body, so
            that neighbours on a lattice stay clear of each other.
        body: the solids people see.
        pointing: (3,) direction of a cannon or torch; None for the others.
        landmarks: further points along the pointing direction.
        actions: actions of its keys.
        motor: motor on its axle; None for blocks that do not turn.
        joint: motion on the block it sits on; None for a fixed block, and for an axle that its
            motor describes completely.
        gear: its teeth; None for all except cogs.
        thrust: its recoil; None for blocks without one.
        physics: its properties as a body; None for connectors and cargo, which a task describes.
        grabs: true if its far end, opposite to the face it sits on, holds objects that it touches.
        description: text that models read about it.
        root_offset: distance of its root point from the face it sits on, along the face's normal,
            units.
        overlaps_base: true if its own shape reaches into the block it sits on by design, so that
            the two are never compared.
        spin: sense of its rotation until flipped, seen from outside against its axis; None if it
            does not spin, or spins as its motor does.
        categories: groups that list it; the first one is the main one.
        simulated: true if both engines have its physics; otherwise it can be built and not
            simulated.
        by_name: true if only tasks that name it offer it, and no set except "all" contains it.
        default_keys: the keys the game binds to its actions by default, by action.
        sources: source of each figure, by its name: a confidence ("known", "community", "chosen" or
            "unknown"), or that and the source or reason after a colon.
        cost: price in Besiege.
        besiege: its representation in Besiege's machine files.
    """

    name: Name
    kind: Kind
    mass: Positive
    size: Point | None
    center: Point = ORIGIN
    colliders: tuple[Solid, ...] = ()
    body: tuple[Solid, ...] = ()
    pointing: Point | None = None
    landmarks: tuple[Landmark, ...] = ()
    actions: tuple[Name, ...] = ()
    motor: Motor | None = None
    joint: MovingJoint | None = None
    gear: Gear | None = None
    thrust: Thrust | None = None
    physics: Physics | None = None
    grabs: bool = False
    description: str
    root_offset: Amount = 0.0
    overlaps_base: bool = False
    spin: Sense | None = None
    categories: tuple[Name, ...] = ()
    simulated: bool = True
    by_name: bool = False
    default_keys: dict[str, Name] = field(default_factory=dict)
    sources: dict[str, str] = field(default_factory=dict)
    cost: Whole
    besiege: BesiegeEntry


class Module(ModuleFields, frozen=True, kw_only=True):
    """A kind of part, as the catalogue describes it.

    Shapes are in the block's frame: its origin is the root point, where the block touches the face
    it sits on, and +z points away from that face. A starting block's root is its centre, and its
    axes are the world's when it is not turned.

    Attributes:
        faces: the places where others attach, in the order of their labels.
        flames: spheres of fire, which heat objects in contact with them.
        link: kind of a connector: a rigid strut, a rope that pulls and never pushes, a spring, or a
            hose, which holds nothing and levels the fuel of both ends.
        face_of_label: its faces by label.
        root_face: the label of the face it sits by; None if it has none.
    """

    faces: tuple[Face, ...] = ()
    flames: tuple[Sphere, ...] = ()
    link: Link = "rigid"
    face_of_label: Mapping[str, Face] = field(default_factory=dict)
    root_face: str | None = None

    def __post_init__(self) -> None:
        """Derive the lookups of faces: by label, and the one the block sits on."""
        force_setattr(self, "face_of_label", {face.label: face for face in self.faces})
        root_face = None if self.kind == "start" else _mount_face(self.faces, self.root_offset)
        force_setattr(self, "root_face", root_face)

    @property
    def attachable(self) -> bool:
        """True if it can be attached to a face."""
        return self.kind in ATTACHABLE_KINDS

    @property
    def is_loose(self) -> bool:
        """True if it lies on its face without an attachment."""
        return self.physics is not None and self.physics.joint_type == "loose"

    @property
    def spins(self) -> bool:
        """True if it has a spin that can be flipped."""
        return self.spin_sense is not None

    @property
    def spin_sense(self) -> Sense | None:
        """Sense of its rotation until flipped, seen from outside; None if it does not spin."""
        if self.motor is not None:
            return self.motor.forward_sense
        drive = None if self.joint is None else self.joint.drive
        return self.spin if drive is None else drive.forward_sense


class Catalogue(Mapping[str, Module]):
    """The modules a machine may be made of, by name, in the order of their files.

    Attributes:
        data_sheets: true if builders read each module's numbers besides its description.
    """

    def __init__(self, modules: tuple[Module, ...], *, data_sheets: bool = False) -> None:
        """Create a catalogue of modules with distinct names, exactly one of them a starting block.

        Raises:
            CatalogueError: two modules of one name, or not exactly one starting block.
        """
        self._modules: dict[str, Module] = {}
        for module in modules:
            if module.name in self._modules:
                raise CatalogueError(f"{module.name}: a module of this name exists already")
            self._modules[module.name] = module
        self._names = CaselessNames(self._modules)
        starts = [module for module in modules if module.kind == "start"]
        if len(starts) != 1:
            names = ", ".join(start.name for start in starts) or "none"
            raise CatalogueError(f"a catalogue has one starting block, not {names}")
        self.start = starts[0]
        self.data_sheets = data_sheets

    @cached_property
    def with_data_sheets(self) -> Catalogue:
        """The same modules with their data sheets."""
        return Catalogue(tuple(self._modules.values()), data_sheets=True)

    def __getitem__(self, name: str) -> Module:
        return self._modules[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._modules)

    def __len__(self) -> int:
        return len(self._modules)

    def __repr__(self) -> str:
        return f"Catalogue({', '.join(self._modules)})"

    def named(self, written: str) -> Module | None:
        """Return the module of a name, ignoring case and spaces; None if there is none."""
        name = self._names.find(written)
        return None if name is None else self._modules[name]

    @property
    def attachable(self) -> tuple[str, ...]:
        """The names `attach_block_to` takes."""
        return tuple(module.name for module in self._modules.values() if module.attachable)

    @property
    def connectors(self) -> tuple[str, ...]:
        """The names `connect_blocks` takes."""
        return tuple(name for name, module in self._modules.items() if module.kind == "connector")


def _mount_face(faces: tuple[Face, ...], root_offset: float) -> str | None:
    """Return the label of the face that a block uses up by sitting on it.

    It is the one that coincides with the face it sits on, else the lowest that looks there.
    """
    touched = (0.0, 0.0, -root_offset)
    facing = [face for face in faces if face.normal[2] < _FACING]
    for face in facing:
        flush = math.dist(face.center, touched) < FLUSH_TOLERANCE
        if flush and face.normal[2] < FLUSH_TOLERANCE - 1:
            return face.label
    return min(facing, key=lambda face: face.center[2]).label if facing else None
