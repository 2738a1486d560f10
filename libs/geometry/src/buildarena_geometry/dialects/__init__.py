"""Published tool interfaces' names for modules and faces, for reading their records."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from importlib import resources
from typing import Any

from msgspec import structs

from buildarena_geometry.blocks import Block
from buildarena_geometry.machine import Machine
from buildarena_geometry.modules.module import Catalogue, Module
from buildarena_geometry.modules.sets import module_set


@dataclass(frozen=True, slots=True, kw_only=True)
class Dialect:
    """Names and conventions of one published interface.

    Attributes:
        catalogue: modules with its names, labels and figures; None for the native one.
        kinds: its names for kinds of outcome, where they differ.
        connector_center: distance of a connector's displayed position from its start, along that
            face's normal, units.
        keeps_lost_mounts: true if a block whose base was removed is still reported as sitting
            there.
        modules: native module names by the interface's, where they differ.
        faces: prefix of its face labels, before the face's index; "" for native labels.
    """

    catalogue: Catalogue | None = None
    kinds: Mapping[str, str] = field(default_factory=dict)
    connector_center: float = 0.0
    keeps_lost_mounts: bool = False
    modules: Mapping[str, str] = field(default_factory=dict)
    faces: str = ""

    def ours(self, arguments: Mapping[str, Any], machine: Machine) -> dict[str, Any]:
        """Translate an action's arguments to native names; unknown ones stay unchanged.

        Args:
            arguments: arguments in the interface's record.
            machine: machine before the action; its blocks map a face index to a face.
        """
        spoken = dict(arguments)
        for argument in ("new_block", "connector", "module"):
            name = spoken.get(argument)
            if isinstance(name, str):
                spoken[argument] = self.modules.get(name, name)
        for block, face in (("base_block", "face"), ("block_a", "face_a"), ("block_b", "face_b")):
            if face in spoken:
                base = machine.blocks.get(str(spoken.get(block)))
                spoken[face] = self._our_face(base, spoken[face])
        return spoken

    def _our_face(self, block: Block | None, label: Any) -> Any:
        index = str(label).removeprefix(self.faces)
        if block is None or not self.faces or not index.isdecimal():
            return label
        faces = block.module.faces
        return faces[int(index)].label if int(index) < len(faces) else label


@cache
def dialects() -> Mapping[str, Mapping[str, Any]]:
    """Return the interfaces by their version."""
    text = resources.files(__package__).joinpath("dialects.json").read_text(encoding="utf-8")
    definitions: dict[str, dict[str, Any]] = json.loads(text)
    return definitions


@cache
def dialect(version: str) -> Dialect:
    """Return the interface of a version.

    Raises:
        ValueError: the version is unknown.
    """
    if version not in dialects():
        raise ValueError(f"unknown dialect {version!r}; valid dialects: {', '.join(dialects())}")
    definition = dialects()[version]
    if definition["set"] == "basic":
        return Dialect()
    modules = tuple(
        _spoken(module, definition) for module in module_set(definition["set"]).values()
    )
    same = ("kinds", "connector_center", "keeps_lost_mounts", "faces")
    return Dialect(
        catalogue=Catalogue(modules),
        modules={theirs: name for name, theirs in definition["names"].items()},
        **{name: definition[name] for name in same},
    )


def _spoken(module: Module, definition: Mapping[str, Any]) -> Module:
    """Return a module with the interface's name, labels and figures."""
    values: dict[str, Any] = {
        name: tuple(value) if isinstance(value, list) else value
        for name, value in definition["figures"].get(module.name, {}).items()
    }
    faces = tuple(
        replace(face, label=f"{definition['faces']}{index}")
        for index, face in enumerate(module.faces)
    )
    name = definition["names"].get(module.name, module.name)
    return structs.replace(module, name=name, faces=faces, **values)
