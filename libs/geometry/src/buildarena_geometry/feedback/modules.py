"""The modules in words: what a builder may use."""

from __future__ import annotations

from typing import TYPE_CHECKING

from buildarena_geometry.feedback.words import plain

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator

    from buildarena_geometry.modules.module import Catalogue, Module


def modules_text(catalogue: Catalogue, names: Collection[str] | None = None) -> str:
    """The modules for people and models, a line each: size, mass and what they are.

    Args:
        catalogue: the modules.
        names: only these, and the starting block; all that can be built by default.
    """
    return "\n".join(_module_line(module) for module in _chosen(catalogue, names))


def modules_in_short(catalogue: Catalogue, names: Collection[str] | None = None) -> str:
    """The same without letters and descriptions, for those who work from a drawing.

    Args:
        catalogue: the modules.
        names: as in `modules_text`.
    """
    lines = []
    for module in _chosen(catalogue, names):
        actions = f", does {', '.join(module.actions)}" if module.actions else ""
        lines.append(f"- {module.name}: {_size(module)}, mass {plain(module.mass)}{actions}")
    return "\n".join(lines)


def _chosen(catalogue: Catalogue, names: Collection[str] | None) -> Iterator[Module]:
    for module in catalogue.values():
        wanted = names is None or module.name in names
        if module.kind == "start" or (module.kind != "cargo" and wanted):
            yield module


def _size(module: Module) -> str:
    return "connector" if module.size is None else " x ".join(map(plain, module.size))


def _module_line(module: Module) -> str:
    facts = [_size(module), f"mass {plain(module.mass)}"]
    if module.faces:
        facts.append(f"faces {' '.join(face.label for face in module.faces)}")
    if module.actions:
        facts.append(f"actions {', '.join(module.actions)}")
    return f"- {module.name} ({'; '.join(facts)}): {module.description}"
