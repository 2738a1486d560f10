"""Reads module files into the catalogue machines are built from.

The library's own file, `modules.yaml`, is written in the subset of YAML that is JSON, so that
reading it takes the standard library alone. A user's file may be JSON, or any YAML where PyYAML is
installed.
`modules.schema.json` describes the format for editors.

What a module does (its physics, motor, thrust and flames) may be left out of a user's file: it is
then what the first basic module of the same kind does.
"""

import json
import math
from collections.abc import Mapping
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Annotated, Any

from msgspec import Meta

from buildarena_geometry.errors import CatalogueError
from buildarena_geometry.modules.forces import check_forces
from buildarena_geometry.modules.joints import checked_joint
from buildarena_geometry.modules.module import Catalogue, Face, Link, Module, ModuleFields, Sphere
from buildarena_geometry.poses import Pose
from buildarena_geometry.rotations import dot, from_axes
from buildarena_geometry.struct_reader import FieldError, Form, Point, Whole, read, refuse

CATALOGUE_VERSION = 1
CONFIDENCES = ("known", "community", "chosen", "unknown")
_WITHOUT_PHYSICS = ("connector", "cargo")
_TOLERANCE = 1e-6  # what six written digits may miss of a unit length or a right angle
_DIRECTIONS = ("pointing", "joint.axis", "push.direction", "wing.normal", "flywheel.axis")
_ACTIONS = (
    *("motor.forward", "motor.backward", "thrust.action", "push.action"),
    *("joint.drive.forward", "joint.drive.backward", "altitude.rise", "altitude.sink"),
    *("spring.contract", "decouple.action", "grip.grab", "grip.release", "push.reverse"),
    *("flywheel.left", "flywheel.right"),
)


class FaceEntry(Form, frozen=True, kw_only=True):
    """A face as a module file describes it.

    Attributes:
        label: the letter models name it by.
        center: (3,) block frame, units.
        normal: (3,) outwards, block frame, unit length.
        x_axis: (3,) the x axis of a block attached here, perpendicular to the normal, unit length.
    """

    label: Annotated[str, Meta(max_length=20)]
    center: Point
    normal: Point
    x_axis: Point

    def __post_init__(self) -> None:
        """Refuse axes without a direction."""
        _check_direction("normal", self.normal)
        _check_direction("x_axis", self.x_axis)
        if abs(dot(self.normal, self.x_axis)) > _TOLERANCE:
            refuse("x_axis", "a direction perpendicular to the normal", self.x_axis)

    @property
    def face(self) -> Face:
        """The face."""
        turn = from_axes(self.x_axis, self.normal)
        return Face(label=self.label, block_from_face=Pose(position=self.center, quaternion=turn))


class ModuleEntry(ModuleFields, frozen=True, kw_only=True):
    """A module as a module file describes it; see `Module`."""

    faces: tuple[FaceEntry, ...] = ()
    link: Link | None = None


class ModuleFile(Form, frozen=True, kw_only=True):
    """A module file."""

    version: Whole
    modules: tuple[Any, ...]


def load_catalogue(*files: str | Path) -> Catalogue:
    """Load the modules machines are built from: the basic ones, and those of further files.

    Args:
        files: module files, JSON or YAML; their modules come after the basic ones.

    Returns:
        The catalogue, a mapping from names to modules.

    Raises:
        CatalogueError: a file can't be read, breaks the format, or names a module a second time.
    """
    modules = basic_modules()
    for file in files:
        modules += _read_file(Path(file), basic_modules())
    return Catalogue(modules)


@cache
def basic_modules() -> tuple[Module, ...]:
    """Return the paper's six modules, the starting block and the cargo."""
    return _own_file("modules.yaml")


@cache
def extended_modules() -> tuple[Module, ...]:
    """Return the further types: modules of the game Besiege that the paper does not have."""
    return _own_file("extended.yaml")


def _own_file(name: str) -> tuple[Module, ...]:
    text = resources.files(__package__).joinpath(name).read_text(encoding="utf-8")
    return read_modules(json.loads(text), where=name)


def read_modules(
    content: object, *, where: str, basic: tuple[Module, ...] = ()
) -> tuple[Module, ...]:
    """Parse the modules of a module file.

    Args:
        content: content of the file, JSON values.
        where: name of the file in messages.
        basic: modules whose behaviour is the default for those of their kind.

    Raises:
        CatalogueError: the content breaks the format.
    """
    file = read(content, ModuleFile, where=where, error=CatalogueError)
    if file.version != CATALOGUE_VERSION:
        expected = f"expected version {CATALOGUE_VERSION}"
        raise CatalogueError(f"{where}.version: {expected}, found {file.version}")
    usual_of: dict[str, Module] = {module.kind: module for module in reversed(basic)}
    return tuple(
        _module(entry, f"{where}.modules[{index}]", usual_of)
        for index, entry in enumerate(file.modules)
    )


def _read_file(file: Path, basic: tuple[Module, ...]) -> tuple[Module, ...]:
    try:
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise CatalogueError(f"{file}: can't be read: {error}") from error
    try:
        content = json.loads(text)
    except json.JSONDecodeError:
        content = _parse_yaml(text, file)
    return read_modules(content, where=file.name, basic=basic)


def _parse_yaml(text: str, file: Path) -> object:
    try:
        import yaml
    except ImportError as error:
        advice = "for other YAML install buildarena-geometry[yaml]"
        raise CatalogueError(f"{file}: is not JSON; {advice}") from error
    try:
        return yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise CatalogueError(f"{file}: is not YAML: {error}") from error


def _module(content: object, where: str, usual_of: Mapping[str, Module]) -> Module:
    name = content.get("name") if isinstance(content, dict) else None
    where = f"{where} ({name:.60})" if isinstance(name, str) else where
    entry = read(content, ModuleEntry, where=where, error=CatalogueError)
    usual = usual_of.get(entry.kind)
    try:
        _check_entry(entry)
        module = _build_module(entry, usual)
        _check_use(entry, module)
    except FieldError as misfit:
        raise CatalogueError(f"{where}{misfit}") from None
    return module


def _build_module(entry: ModuleEntry, usual: Module | None) -> Module:
    """Create the module of an entry, with its kind's defaults for what the entry leaves out."""
    shared = {name: getattr(entry, name) for name in ModuleFields.__struct_fields__}
    for name in ("thrust", "physics"):
        shared[name] = shared[name] or getattr(usual, name, None)
    if entry.joint is not None:
        # An entry with a joint describes its motion, and does not get the default motor.
        joint_type = getattr(shared["physics"], "joint_type", None)
        shared["joint"] = checked_joint(entry.joint, joint_type)
    elif entry.motor is None and usual is not None:
        shared["motor"] = usual.motor
    flames = tuple(
        Sphere(along=mark.along, radius=mark.radius)
        for mark in entry.landmarks
        if mark.heats and mark.radius is not None
    )
    return Module(
        **shared,
        faces=tuple(face.face for face in entry.faces),
        flames=flames or (usual.flames if usual else ()),
        link=entry.link or "rigid",
    )


def _check_entry(entry: ModuleEntry) -> None:
    """Refuse entries whose fields are each valid but inconsistent together."""
    for place in _DIRECTIONS:
        if (direction := _at(entry, place)) is not None:
            _check_direction(place, direction)
    for place in _ACTIONS:
        if (action := _at(entry, place)) is not None and action not in entry.actions:
            refuse(place, f"one of {', '.join(entry.actions)}", action)
    _check_names(entry)
    check_forces(entry, kind=entry.kind, mass=entry.mass, link=entry.link)
    if len({face.label for face in entry.faces}) != len(entry.faces):
        raise FieldError(".faces: two faces share a label")
    if entry.landmarks and entry.pointing is None:
        raise FieldError(".landmarks: they lie along `pointing`, which is missing")
    if entry.kind == "connector" and (entry.colliders or entry.faces):
        raise FieldError(": a connector has neither faces nor colliders")
    if entry.kind != "connector" and (entry.size is None or not entry.colliders):
        raise FieldError(f": a {entry.kind} needs a size and colliders")


def _check_names(entry: ModuleEntry) -> None:
    """Refuse keys of actions that the module does not have, and sources of no known kind."""
    for place, keys in (("default_keys", entry.default_keys), ("besiege.keys", entry.besiege.keys)):
        for action, key in keys.items():
            if action not in entry.actions:
                names = ", ".join(entry.actions) or "none"
                refuse(f"{place}.{action}", f"keys of the actions {names} only", key)
    for figure, source in entry.sources.items():
        if source.partition(":")[0] not in CONFIDENCES:
            sure = f"a text that begins with one of {', '.join(CONFIDENCES)}"
            refuse(f"sources.{figure}", sure, source)


def _check_use(entry: ModuleEntry, module: Module) -> None:
    """Refuse properties that a module of this form cannot have."""
    kind = module.kind
    if kind in _WITHOUT_PHYSICS:
        for name in ("motor", "thrust"):
            _check_absent(entry, name, f"a {kind} does nothing by itself")
        _check_absent(entry, "physics", f"a {kind} is not a body of its own")
    if kind != "connector":
        _check_absent(entry, "link", f"a {kind} is not a connector")
    if entry.spin and module.motor is not None and entry.spin != module.spin_sense:
        refuse("spin", f"{module.spin_sense}, as its motor's forward_sense", entry.spin)
    if module.pointing is None:
        _check_absent(entry, "thrust", "it acts along `pointing`, which is missing")
    joint_type = None if module.physics is None else module.physics.joint_type
    if joint_type != "axle":
        _check_absent(entry, "gear", f"a cog's joint type is axle, not {joint_type}")
        if module.motor is not None:
            raise FieldError(": a motor needs the joint type axle")
    elif (module.motor is None) == (module.joint is None):
        raise FieldError(": the joint type axle needs either a motor or a joint")


def _check_absent(entry: ModuleEntry, name: str, reason: str) -> None:
    if (value := getattr(entry, name)) is not None:
        refuse(name, f"no {name}: {reason}", value)


def _check_direction(place: str, vector: Point) -> None:
    if abs(math.hypot(*vector) - 1) > _TOLERANCE:
        refuse(place, "a direction, three numbers with length 1", vector)


def _at(entry: ModuleEntry, place: str) -> Any:
    """Return an entry's value at a dotted path; None if it has none."""
    value: Any = entry
    for name in place.split("."):
        value = None if value is None else getattr(value, name)
    return value
