"""Reads module files into the catalogue machines are built from.

The library's own file, `modules.yaml`, is written in the subset of YAML that is JSON, so that
reading it takes the standard library alone. A user's file may be JSON, or any YAML where PyYAML is
installed.
`modules.schema.json` describes the format for editors.
"""

from __future__ import annotations

import json
from functools import cache
from importlib import resources
from pathlib import Path
from typing import cast

from buildarena_geometry.errors import CatalogueError
from buildarena_geometry.modules.module import (
    KINDS,
    Box,
    Catalogue,
    Cylinder,
    Face,
    Kind,
    Landmark,
    Module,
    Solid,
)
from buildarena_geometry.poses import Pose
from buildarena_geometry.reading import Reader
from buildarena_geometry.rotations import ORIGIN, dot, from_axes

CATALOGUE_VERSION = 1
_REQUIRED = ("name", "kind", "mass", "cost", "size", "description", "besiege")
_OPTIONAL = ("center", "faces", "colliders", "body", "pointing", "landmarks", "actions")
_PERPENDICULAR = 1e-6


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
        modules = (*modules, *_read_file(Path(file)))
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
    text = resources.files(__package__).joinpath("modules.yaml").read_text(encoding="utf-8")
    return read_modules(json.loads(text), where="modules.yaml")


def read_modules(content: object, *, where: str) -> tuple[Module, ...]:
    """The modules of a parsed module file.

    Args:
        content: what the file holds, as JSON values.
        where: what messages call the file.

    Raises:
        CatalogueError: the content breaks the format.
    """
    fields = Reader(value=content, where=where, error=CatalogueError).fields(
        required=("version", "modules")
    )
    if fields["version"].integer() != CATALOGUE_VERSION:
        fields["version"].fail(f"version {CATALOGUE_VERSION}")
    return tuple(_module(entry) for entry in fields["modules"].items())


def _read_file(file: Path) -> tuple[Module, ...]:
    try:
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise CatalogueError(f"{file}: can't be read: {error}") from error
    try:
        content = json.loads(text)
    except json.JSONDecodeError:
        content = _parse_yaml(text, file)
    return read_modules(content, where=file.name)


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


def _module(entry: Reader) -> Module:
    fields = entry.fields(required=_REQUIRED, optional=_OPTIONAL)
    name = fields["name"].text(longest=60)
    entry = Reader(value=entry.value, where=f"{entry.where} ({name})", error=entry.error)
    fields = entry.fields(required=_REQUIRED, optional=_OPTIONAL)
    kind = cast("Kind", fields["kind"].choice(KINDS))
    besiege = fields["besiege"].fields(required=("id", "data"))
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
        landmarks=tuple(map(_landmark, fields.items("landmarks"))),
        actions=tuple(action.text(longest=60) for action in fields.items("actions")),
        description=fields["description"].text(),
        besiege_data=tuple(map(_besiege_entry, besiege["data"].items())),
    )
    _check_sense(module, entry)
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


def _face(entry: Reader) -> Face:
    fields = entry.fields(required=("label", "center", "normal", "x_axis"))
    normal, x_axis = fields["normal"].direction(), fields["x_axis"].direction()
    if abs(dot(normal, x_axis)) > _PERPENDICULAR:
        fields["x_axis"].fail("a direction perpendicular to the normal")
    pose = Pose(position=fields["center"].vector(), quaternion=from_axes(x_axis, normal))
    return Face(label=fields["label"].text(longest=20), block_from_face=pose)


def _solid(entry: Reader) -> Solid:
    shape = entry.fields(required=("shape", "from", "to"), optional=("radius",))
    start, end = shape["from"].vector(), shape["to"].vector()
    if shape["shape"].choice(("box", "cylinder")) == "box":
        if not all(low < high for low, high in zip(start, end, strict=True)):
            shape["to"].fail(f"three numbers, each larger than in {list(start)}")
        if "radius" in shape:
            shape["radius"].fail("no radius: a box has none")
        return Box(lowest=start, highest=end)
    if start == end:
        shape["to"].fail("another point than `from`")
    return Cylinder(radius=shape["radius"].number(above=0), base=start, top=end)


def _landmark(entry: Reader) -> Landmark:
    fields = entry.fields(required=("name", "along"), optional=("radius",))
    radius = fields["radius"].number(above=0) if "radius" in fields else None
    name = fields["name"].text(longest=60)
    return Landmark(name=name, along=fields["along"].number(), radius=radius)


def _besiege_entry(entry: Reader) -> tuple[str, str, str | int | float | bool]:
    fields = entry.fields(required=("type", "key", "value"))
    value = fields["value"]
    if not isinstance(value.value, str | int | float):
        value.fail("a text, a number, or true or false")
    return (fields["type"].text(), fields["key"].text(), value.value)
