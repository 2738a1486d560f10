"""What machines are made of: modules, their faces and their shapes."""

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
from buildarena_geometry.reading import Amount, Finite, Form, Name, Point, Positive, refuse
from buildarena_geometry.rotations import ORIGIN, Vector

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
    """A point of a module that matters to its use, such as a cannon's outlet or a torch's flame.

    Attributes:
        name: what it is.
        along: how far it lies from the block's centre in the pointing direction, units.
        radius: of the sphere around it, units; None for a mere point.
        heats: whether it is a flame, a sphere that heats what it touches.
    """

    name: Name
    along: Finite
    radius: Positive | None = None
    heats: bool = False

    def __post_init__(self) -> None:
        """Refuses a flame without a radius."""
        if self.heats and self.radius is None:
            refuse("radius", "the radius of a flame, which is a sphere", self.radius)


class Sphere(Form, frozen=True, kw_only=True):
    """A sphere on the line through a block's centre in the pointing direction.

    Attributes:
        along: how far its centre lies from the block's centre in the pointing direction, units.
        radius: units.
    """

    along: Finite
    radius: Positive


class Motor(Form, frozen=True, kw_only=True):
    """What turns a wheel about its axle while a key is held; without a key it brakes.

    Attributes:
        speed_rpm: how fast it turns, revolutions per minute.
        lag_per_s: rate of the first-order lag with which its target speed follows the keys, 1/s.
        torque: its limit, mass·g·unit.
        forward: the action that turns it forward.
        backward: the action that turns it backward.
        forward_sense: which way forward is, seen from outside against its axle, until its spin is
            flipped.
        origin: where the figures come from.
    """

    speed_rpm: Positive
    lag_per_s: Positive
    torque: Positive
    forward: str
    backward: str
    forward_sense: Sense
    origin: str = ""

    @property
    def speed(self) -> float:
        """How fast it turns, rad/s."""
        return self.speed_rpm * 2.0 * math.pi / 60.0


class Thrust(Form, frozen=True, kw_only=True):
    """What pushes a cannon against the way it points while its key is held.

    Attributes:
        action: the action that fires it.
        along: how far the point the push acts on lies from the block's centre in the pointing
            direction, units.
        cold: the push without a flame, mass·g.
        heated: the push while a flame touches one of the spheres, mass·g.
        spheres: the body that a flame must touch.
        origin: where the figures come from.
    """

    action: str
    along: Finite
    cold: Amount
    heated: Amount
    spheres: tuple[Sphere, ...]
    origin: str = ""


class Physics(Form, frozen=True, kw_only=True):
    """How a block behaves as a body, whatever simulates it.

    Attributes:
        joint_type: what holds it to the face it sits on: an ordinary attachment, a mount that
            practically never breaks, a joint it moves on: an axle, a hinge, a slider, a ball, or a
            constant-velocity joint, or nothing: what is loose lies there.
        mass_at: where its mass lies: at the point shown as its position, or in the middle of its
            body.
        structural: whether it is part of the frame that bears loads: what a far end can grab, and
            what rests on ground and terrain.
        friction: its coefficient of friction.
        linear_drag: share of its velocity it loses, 1/s.
        angular_drag: share of its spin it loses, 1/s.
        origin: where the figures come from.
    """

    joint_type: JointType
    mass_at: Literal["center", "body"]
    structural: bool
    friction: Amount
    linear_drag: Amount
    angular_drag: Amount
    origin: str = ""


class ModuleFields(Forces, frozen=True, kw_only=True):
    """What a module and its entry in a module file both say, besides the forces it exerts.

    Attributes:
        name: what models call it.
        kind: what it does.
        mass: mass units; a cargo's until its task sets another.
        size: (3,) its extent along x, y and z, units; None for connectors.
        center: (3,) the point shown to models as its position.
        colliders: the convex solids that may not overlap another block's; smaller than the body, so
            that neighbours on a lattice stay clear of each other.
        body: the solids people see.
        pointing: (3,) the way a cannon or torch points; None for the others.
        landmarks: further points along the pointing direction.
        actions: what its keys can make it do.
        motor: what turns it on its axle; None for blocks that do not turn.
        joint: how it moves on the block it sits on; None for one that does not, and for an axle
            that its motor describes completely.
        gear: its teeth; None for all but cogs.
        thrust: what pushes it; None for blocks that do not push.
        physics: how it behaves as a body; None for connectors and cargo, which a task describes.
        grabs: whether its far end, opposite to the face it sits on, holds what it touches.
        description: what models read about it.
        root_offset: how far off the face it sits on its root point lies, along the face's normal,
            units.
        overlaps_base: whether its own shape reaches into the block it sits on by design, so that
            the two are never compared.
        spin: which way it turns as it is, seen from outside against its axis; None where it has no
            spin of its own, or the one of its motor.
        categories: the groups it is looked up in; the first one is its own.
        simulated: whether both engines have its physics; without, it can be built and not tried.
        by_name: whether only tasks that name it offer it: no set but "all" has it.
        default_keys: the keys the game binds to its actions by default, by action.
        sources: where a figure comes from, by its name: a confidence ("known", "community",
            "chosen" or "unknown"), or that and the source or reason after a colon.
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


class Module(ModuleFields, frozen=True, kw_only=True):
    """A kind of part, as the catalogue describes it.

    Shapes are in the block's frame: its origin is the root point, where the block touches the face
    it sits on, and +z points away from that face. A starting block's root is its centre, and its
    axes are the world's when it is not turned.

    Attributes:
        cost: Besiege's price.
        faces: the places where others attach, in the order of their labels.
        flames: spheres of fire, which heat what they touch.
        link: what a connector is: a rigid strut, a rope that pulls and never pushes, a spring, or a
            hose, which holds nothing and levels the fuel of both ends.
        besiege_id: its number in Besiege's machine files.
        besiege_data: further entries of its block in Besiege's machine files: type, key, value.
        besiege_keys: the entry there that holds the keys of an action, by the action.
        face_of_label: its faces by label.
        root_face: the label of the face it sits by; None if it has none.
    """

    cost: int
    faces: tuple[Face, ...] = ()
    flames: tuple[Sphere, ...] = ()
    link: Link = "rigid"
    besiege_id: int
    besiege_data: tuple[tuple[str, str, str | int | float | bool], ...] = ()
    besiege_keys: Mapping[str, str] = field(default_factory=dict)
    face_of_label: Mapping[str, Face] = field(default_factory=dict)
    root_face: str | None = None

    def __post_init__(self) -> None:
        """Derives the lookups of faces: by label, and the one the block sits on."""
        force_setattr(self, "face_of_label", {face.label: face for face in self.faces})
        root_face = None if self.kind == "start" else _mount_face(self.faces, self.root_offset)
        force_setattr(self, "root_face", root_face)

    @property
    def attachable(self) -> bool:
        """Whether it can be attached to a face."""
        return self.kind in ATTACHABLE_KINDS

    @property
    def is_loose(self) -> bool:
        """Whether it lies on its face and nothing holds it there."""
        return self.physics is not None and self.physics.joint_type == "loose"

    @property
    def spins(self) -> bool:
        """Whether it has a spin that can be flipped."""
        return self.spin_sense is not None

    @property
    def spin_sense(self) -> Sense | None:
        """Which way it turns until its spin is flipped, seen from outside; None without a spin."""
        if self.motor is not None:
            return self.motor.forward_sense
        drive = None if self.joint is None else self.joint.drive
        return self.spin if drive is None else drive.forward_sense


class Catalogue(Mapping[str, Module]):
    """The modules a machine may be made of, by name, in the order of their files.

    Attributes:
        start: the starting block.
        data_sheets: whether builders read each module's numbers, not its description alone.
    """

    def __init__(self, modules: tuple[Module, ...], *, data_sheets: bool = False) -> None:
        """Takes modules with distinct names, exactly one of them a starting block.

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

    def with_data_sheets(self) -> Catalogue:
        """The same modules, told with their numbers; always the same object."""
        return self if self.data_sheets else self._with_data_sheets

    @cached_property
    def _with_data_sheets(self) -> Catalogue:
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
        """The module a name means, whatever its case and spaces; None if there is none."""
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
    """The face that a block uses up by sitting on it.

    It is the one that coincides with the face it sits on, else the lowest that looks there.
    """
    touched = (0.0, 0.0, -root_offset)
    facing = [face for face in faces if face.normal[2] < _FACING]
    for face in facing:
        flush = math.dist(face.center, touched) < FLUSH_TOLERANCE
        if flush and face.normal[2] < FLUSH_TOLERANCE - 1:
            return face.label
    return min(facing, key=lambda face: face.center[2]).label if facing else None
