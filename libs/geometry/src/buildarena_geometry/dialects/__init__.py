"""What published tool interfaces call modules and faces, so that their records can be read."""

from __future__ import annotations

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
    """How one published interface speaks.

    Attributes:
        catalogue: the modules with its names, labels and figures; None for ours.
        kinds: what it calls a kind of outcome, where it differs.
        connector_center: how far off its start a connector is shown, along that face's normal,
            units.
        keeps_lost_mounts: whether a block whose base was removed is still reported to sit there.
        modules: our names by its names, where they differ.
        faces: what its face labels begin with, before the face's index; "" where they are ours.
    """

    catalogue: Catalogue | None = None
    kinds: Mapping[str, str] = field(default_factory=dict)
    connector_center: float = 0.0
    keeps_lost_mounts: bool = False
    modules: Mapping[str, str] = field(default_factory=dict)
    faces: str = ""

    def ours(self, arguments: Mapping[str, Any], machine: Machine) -> dict[str, Any]:
        """An action's arguments in our words; what it does not know stays as it is.

        Args:
            arguments: as the interface's record has them.
            machine: the machine before the action; its blocks say which face an index means.
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
    """The interfaces by their version."""
    text = resources.files(__package__).joinpath("dialects.json").read_text(encoding="utf-8")
    definitions: dict[str, dict[str, Any]] = json.loads(text)
    return definitions


@cache
def dialect(version: str) -> Dialect:
    """The interface of a version.

    Raises:
        ValueError: there is no such version.
    """
    if version not in dialects():
        raise ValueError(f"there is no dialect {version!r}; they are {', '.join(dialects())}")
    definition = dialects()[version]
    if definition["set"] == "basic":
        return Dialect()
    modules = tuple(
        _spoken(module, definition) for module in module_set(definition["set"]).values()
    )
    return Dialect(
        catalogue=Catalogue(modules),
        kinds=definition["kinds"],
        connector_center=definition["connector_center"],
        keeps_lost_mounts=definition["keeps_lost_mounts"],
        modules={theirs: name for name, theirs in definition["names"].items()},
        faces=definition["faces"],
    )


def _spoken(module: Module, definition: Mapping[str, Any]) -> Module:
    """A module with the interface's name, labels and figures."""
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
