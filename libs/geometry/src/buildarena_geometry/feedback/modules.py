"""The modules in words: what a builder may use."""

from __future__ import annotations

from typing import TYPE_CHECKING

from buildarena_geometry.feedback.words import plain

if TYPE_CHECKING:
    from collections.abc import Collection

    from buildarena_geometry.modules.module import Catalogue, Module


def modules_text(catalogue: Catalogue, names: Collection[str] | None = None) -> str:
    """The modules for people and models, a line each: size, mass and what they are.

    Args:
        catalogue: the modules.
        names: only these, and the starting block; all that can be built by default.
    """
    return "\n".join(
        _module_line(module)
        for module in catalogue.values()
        if module.kind == "start"
        or (module.kind != "cargo" and (names is None or module.name in names))
    )


def _module_line(module: Module) -> str:
    size = "connector" if module.size is None else " x ".join(map(plain, module.size))
    facts = [size, f"mass {plain(module.mass)}"]
    if module.faces:
        facts.append(f"faces {' '.join(face.label for face in module.faces)}")
    if module.actions:
        facts.append(f"actions {', '.join(module.actions)}")
    return f"- {module.name} ({'; '.join(facts)}): {module.description}"
