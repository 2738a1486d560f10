"""Reads module files into the catalogue machines are built from.

The library's own file, `modules.yaml`, is written in the subset of YAML that is JSON, so that
reading it takes the standard library alone. A user's file may be JSON, or any YAML where PyYAML is
installed.
`modules.schema.json` describes the format for editors.

What a module does (its physics, motor, thrust and flames) may be left out of a user's file: it is
then what the first basic module of the same kind does.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from pathlib import Path
from typing import cast

from buildarena_geometry.errors import CatalogueError
from buildarena_geometry.modules.facts import FACT_FIELDS, read_facts
from buildarena_geometry.modules.forces import FORCE_FIELDS, read_forces
from buildarena_geometry.modules.joints import SENSES, Sense, read_gear, read_joint
from buildarena_geometry.modules.module import (
    KINDS,
    LINKS,
    MASS_PLACES,
    SEATS,
    Catalogue,
    Face,
    Kind,
    Landmark,
    Link,
    MassPlace,
    Module,
    Motor,
    Physics,
    Seat,
    Sphere,
    Thrust,
)
from buildarena_geometry.modules.solids import Ball, Box, Cylinder, Solid
from buildarena_geometry.poses import Pose
from buildarena_geometry.reading import Fields, Reader
from buildarena_geometry.rotations import ORIGIN, dot, from_axes

CATALOGUE_VERSION = 1
_REQUIRED = ("name", "kind", "mass", "cost", "size", "description", "besiege")
_SHAPE = ("center", "faces", "colliders", "body", "pointing", "landmarks")
_USE = ("actions", "motor", "joint", "gear", "thrust", "physics", "grabs", "link")
_RULES = ("root_offset", "overlaps_base", "spin")
_OPTIONAL = (*_SHAPE, *_USE, *_RULES, *FACT_FIELDS, *FORCE_FIELDS)
_MOTOR = ("speed_rpm", "lag_per_s", "torque", "forward", "backward", "forward_sense")
_THRUST = ("action", "along", "cold", "heated", "spheres")
_PHYSICS = ("seat", "mass_at", "structural", "friction", "linear_drag", "angular_drag")
_WITHOUT_PHYSICS = ("connector", "cargo")
_PERPENDICULAR = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class _Usual:
    """What modules of a kind do unless they say otherwise; fields as in `Module`."""

    motor: Motor | None = None
    thrust: Thrust | None = None
    physics: Physics | None = None
    flames: tuple[Sphere, ...] = ()


def load_catalogue(*files: str | Path) -> Catalogue:
    """The modules machines are built from: the basic ones, and those of further files.

    Args:
        files: module files, JSON or YAML; their modules come after the basic ones.

    Returns:
        The catalogue, a mapping from names to modules.

    Raises:
        CatalogueError: a file can't be read, breaks the format, or names a module a second time.
    """
    modules = basic_modules()
    for file in files:
        modules = (*modules, *_read_file(Path(file), basic_modules()))
    names: set[str] = set()
    for module in modules:
        if module.name in names:
            raise CatalogueError(f"{module.name}: a module of this name exists already")
        names.add(module.name)
    starts = [module.name for module in modules if module.kind == "start"]
    if len(starts) != 1:
        raise CatalogueError(f"a catalogue has one starting block, not {', '.join(starts)}")
    return Catalogue(modules)


@cache
def basic_modules() -> tuple[Module, ...]:
    """The paper's six modules, the starting block and the cargo."""
    return _own_file("modules.yaml")


@cache
def extended_modules() -> tuple[Module, ...]:
    """The further types: what the game Besiege has besides the paper's modules."""
    return _own_file("extended.yaml")


def _own_file(name: str) -> tuple[Module, ...]:
    text = resources.files(__package__).joinpath(name).read_text(encoding="utf-8")
    return read_modules(json.loads(text), where=name)


def read_modules(
    content: object, *, where: str, basic: tuple[Module, ...] = ()
) -> tuple[Module, ...]:
    """The modules of a parsed module file.

    Args:
        content: what the file holds, as JSON values.
        where: what messages call the file.
        basic: modules that say what those of their kind do where the file leaves it out.

    Raises:
        CatalogueError: the content breaks the format.
    """
    fields = Reader(value=content, where=where, error=CatalogueError).fields(
        required=("version", "modules")
    )
    if fields["version"].integer() != CATALOGUE_VERSION:
        fields["version"].fail(f"version {CATALOGUE_VERSION}")
    usual_of = {
        module.kind: _Usual(
            motor=module.motor,
            thrust=module.thrust,
            physics=module.physics,
            flames=module.flames,
        )
        for module in reversed(basic)
    }
    return tuple(_module(entry, usual_of) for entry in fields["modules"].items())


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
        raise CatalogueError(
            f"{file}: is not JSON; for other YAML install buildarena-geometry[yaml]"
        ) from error
    try:
        content: object = yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise CatalogueError(f"{file}: is not YAML: {error}") from error
    return content


def _module(entry: Reader, usual_of: Mapping[Kind, _Usual]) -> Module:
    fields = entry.fields(required=_REQUIRED, optional=_OPTIONAL)
    name = fields["name"].text(longest=60)
    entry = Reader(value=entry.value, where=f"{entry.where} ({name})", error=entry.error)
    fields = entry.fields(required=_REQUIRED, optional=_OPTIONAL)
    kind = cast("Kind", fields["kind"].choice(KINDS))
    besiege = fields["besiege"].fields(required=("id", "data"), optional=("keys",))
    usual = usual_of.get(kind, _Usual())
    landmarks = tuple(map(_landmark, fields.items("landmarks")))
    actions = tuple(action.text(longest=60) for action in fields.items("actions"))
    physics = _physics(fields["physics"]) if fields.has("physics") else usual.physics
    seat = None if physics is None else physics.seat
    # A joint says all of how its module turns: one without a motor is free of the usual one.
    motor = None if fields.has("joint") else usual.motor
    module = Module(
        name=name,
        besiege_id=besiege["id"].integer(least=0),
        kind=kind,
        mass=fields["mass"].number(above=0),
        cost=fields["cost"].integer(least=0),
        size=fields["size"].vector() if fields.has("size") else None,
        center=fields["center"].vector() if "center" in fields else ORIGIN,
        faces=tuple(map(_face, fields.items("faces"))),
        colliders=tuple(map(_solid, fields.items("colliders"))),
        body=tuple(map(_solid, fields.items("body"))),
        pointing=fields["pointing"].direction() if fields.has("pointing") else None,
        landmarks=landmarks,
        flames=_flames(landmarks) or usual.flames,
        actions=actions,
        motor=_motor(fields["motor"], actions) if fields.has("motor") else motor,
        joint=read_joint(fields["joint"], seat=seat, actions=actions)
        if fields.has("joint")
        else None,
        gear=read_gear(fields["gear"], seat=seat) if fields.has("gear") else None,
        thrust=_thrust(fields["thrust"], actions) if fields.has("thrust") else usual.thrust,
        physics=physics,
        grabs=fields["grabs"].truth() if "grabs" in fields else False,
        link=cast("Link", fields["link"].choice(LINKS)) if fields.has("link") else "rigid",
        description=fields["description"].text(),
        besiege_data=tuple(map(_besiege_entry, besiege["data"].items())),
        besiege_keys=_besiege_keys(besiege["keys"], actions) if "keys" in besiege else {},
        root_offset=fields["root_offset"].number(least=0) if "root_offset" in fields else 0.0,
        overlaps_base=fields["overlaps_base"].truth() if "overlaps_base" in fields else False,
        spin=cast("Sense", fields["spin"].choice(SENSES)) if fields.has("spin") else None,
        facts=read_facts(fields, actions),
        forces=read_forces(fields, actions),
    )
    _check_sense(module, entry)
    _check_use(module, fields)
    return module


def _check_sense(module: Module, entry: Reader) -> None:
    """Refuses modules whose fields are good one by one and make no sense together."""
    if len(module.face_of_label) != len(module.faces):
        raise CatalogueError(f"{entry.where}.faces: two faces share a label")
    if module.landmarks and module.pointing is None:
        raise CatalogueError(
            f"{entry.where}.landmarks: they lie along `pointing`, which is missing"
        )
    if module.kind == "connector" and (module.colliders or module.faces):
        raise CatalogueError(f"{entry.where}: a connector has neither faces nor colliders")
    if module.kind != "connector" and (module.size is None or not module.colliders):
        raise CatalogueError(f"{entry.where}: a {module.kind} needs a size and colliders")


def _check_use(module: Module, fields: Fields) -> None:
    """Refuses what a module of this form cannot do."""
    for name in ("motor", "thrust"):
        if fields.has(name) and module.kind in _WITHOUT_PHYSICS:
            fields[name].fail(f"no {name}: a {module.kind} does nothing by itself")
    if fields.has("physics") and module.kind in _WITHOUT_PHYSICS:
        fields["physics"].fail(f"no physics: a {module.kind} is not a body of its own")
    if fields.has("link") and module.kind != "connector":
        fields["link"].fail(f"no link: a {module.kind} is not a connector")
    if fields.has("spin") and module.motor is not None and module.spin != module.spin_sense:
        fields["spin"].fail(f"{module.spin_sense}, as its motor's forward_sense")
    if fields.has("thrust") and module.pointing is None:
        fields["thrust"].fail("no thrust: it acts along `pointing`, which is missing")
    seat, place = None if module.physics is None else module.physics.seat, fields.reader.where
    if module.motor is not None and seat != "axle":
        raise CatalogueError(f"{place}: a motor needs the seat axle")
    if seat == "axle" and (module.motor is None) == (module.joint is None):
        raise CatalogueError(f"{place}: the seat axle needs either a motor or a joint")


def _face(entry: Reader) -> Face:
    fields = entry.fields(required=("label", "center", "normal", "x_axis"))
    normal, x_axis = fields["normal"].direction(), fields["x_axis"].direction()
    if abs(dot(normal, x_axis)) > _PERPENDICULAR:
        fields["x_axis"].fail("a direction perpendicular to the normal")
    pose = Pose(position=fields["center"].vector(), quaternion=from_axes(x_axis, normal))
    return Face(label=fields["label"].text(longest=20), block_from_face=pose)


def _solid(entry: Reader) -> Solid:
    if isinstance(entry.value, dict) and entry.value.get("shape") == "sphere":
        ball = entry.fields(required=("shape", "radius", "center"))
        return Ball(radius=ball["radius"].number(above=0), center=ball["center"].vector())
    shape = entry.fields(required=("shape", "from", "to"), optional=("radius",))
    start, end = shape["from"].vector(), shape["to"].vector()
    if shape["shape"].choice(("box", "cylinder", "sphere")) == "box":
        if not all(low < high for low, high in zip(start, end, strict=True)):
            shape["to"].fail(f"three numbers, each larger than in {list(start)}")
        if "radius" in shape:
            shape["radius"].fail("no radius: a box has none")
        return Box(lowest=start, highest=end)
    if start == end:
        shape["to"].fail("another point than `from`")
    return Cylinder(radius=shape["radius"].number(above=0), base=start, top=end)


def _landmark(entry: Reader) -> Landmark:
    fields = entry.fields(required=("name", "along"), optional=("radius", "heats"))
    radius = fields["radius"].number(above=0) if "radius" in fields else None
    heats = fields["heats"].truth() if "heats" in fields else False
    if heats and radius is None:
        raise CatalogueError(f"{entry.where}.radius: it is missing; a flame is a sphere")
    name = fields["name"].text(longest=60)
    return Landmark(name=name, along=fields["along"].number(), radius=radius, heats=heats)


def _flames(landmarks: tuple[Landmark, ...]) -> tuple[Sphere, ...]:
    return tuple(
        Sphere(along=mark.along, radius=mark.radius)
        for mark in landmarks
        if mark.heats and mark.radius is not None
    )


def _sphere(entry: Reader) -> Sphere:
    fields = entry.fields(required=("along", "radius"))
    return Sphere(along=fields["along"].number(), radius=fields["radius"].number(above=0))


def _motor(entry: Reader, actions: tuple[str, ...]) -> Motor:
    fields = entry.fields(required=_MOTOR, optional=("origin",))
    return Motor(
        speed_rpm=fields["speed_rpm"].number(above=0),
        lag_per_s=fields["lag_per_s"].number(above=0),
        torque=fields["torque"].number(above=0),
        forward=fields["forward"].choice(actions),
        backward=fields["backward"].choice(actions),
        forward_sense=cast("Sense", fields["forward_sense"].choice(SENSES)),
        origin=fields.text("origin"),
    )


def _thrust(entry: Reader, actions: tuple[str, ...]) -> Thrust:
    fields = entry.fields(required=_THRUST, optional=("origin",))
    return Thrust(
        action=fields["action"].choice(actions),
        along=fields["along"].number(),
        cold=fields["cold"].number(least=0),
        heated=fields["heated"].number(least=0),
        spheres=tuple(map(_sphere, fields["spheres"].items())),
        origin=fields.text("origin"),
    )


def _physics(entry: Reader) -> Physics:
    fields = entry.fields(required=_PHYSICS, optional=("origin",))
    return Physics(
        seat=cast("Seat", fields["seat"].choice(SEATS)),
        mass_at=cast("MassPlace", fields["mass_at"].choice(MASS_PLACES)),
        structural=fields["structural"].truth(),
        friction=fields["friction"].number(least=0),
        linear_drag=fields["linear_drag"].number(least=0),
        angular_drag=fields["angular_drag"].number(least=0),
        origin=fields.text("origin"),
    )


def _besiege_entry(entry: Reader) -> tuple[str, str, str | int | float | bool]:
    fields = entry.fields(required=("type", "key", "value"))
    value = fields["value"]
    if not isinstance(value.value, str | int | float):
        value.fail("a text, a number, or true or false")
    return (fields["type"].text(), fields["key"].text(), value.value)


def _besiege_keys(entry: Reader, actions: tuple[str, ...]) -> dict[str, str]:
    fields = entry.fields(required=(), optional=actions)
    return {action: fields[action].text(longest=60) for action in actions if action in fields}
