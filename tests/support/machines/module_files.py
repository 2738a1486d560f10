"""Modules as their files write them, and files of one's own."""

import copy
import json
from importlib import resources
from pathlib import Path
from typing import Any

FILES = resources.files("buildarena_geometry.modules")
SCHEMA = json.loads(FILES.joinpath("modules.schema.json").read_text())


def entries(name: str) -> dict[str, Any]:
    """The entries of a file of the library, by the modules' names."""
    return {
        entry["name"]: entry for entry in json.loads(FILES.joinpath(name).read_text())["modules"]
    }


BASIC = entries("modules.yaml")


def like(module: str, name: str, **fields: Any) -> dict[str, Any]:
    """A basic module's entry by another name, some fields of which are others."""
    return {**copy.deepcopy(BASIC[module]), "name": name, **fields}


def module_file(folder: Path, *modules: dict[str, Any]) -> Path:
    file = folder / "modules.json"
    file.write_text(json.dumps({"version": 1, "modules": list(modules)}))
    return file
