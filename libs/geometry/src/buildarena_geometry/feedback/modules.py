"""The modules in words: what a builder may use."""

from __future__ import annotations

from collections.abc import Collection, Iterator

from buildarena_geometry.feedback.data_sheets import data_sheet
from buildarena_geometry.feedback.words import counted, plain, point
from buildarena_geometry.modules.module import Catalogue, Module

OTHER = "other"  # the category of modules that name none


def modules_text(catalogue: Catalogue, names: Collection[str] | None = None) -> str:
    """The modules for people and models: size, mass and what they are.

    Each has a line, and another with its data where the catalogue tells data sheets.

    Args:
        catalogue: the modules.
        names: only these, and the starting block; all that can be built by default.
    """
    chosen = _chosen(catalogue, names)
    return "\n".join(f"- {_module_lines(module, catalogue)}" for module in chosen)


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


def lookup_text(catalogue: Catalogue) -> str:
    """What builders read who look modules up, in place of the modules."""
    count = sum(module.kind not in ("start", "cargo") for module in catalogue.values())
    how = "list_modules names those of a category, describe_module tells all about one or several"
    used = f"{counted(count, 'module')} may be used. Look up what you need: {how}."
    return f"{used}\n{categories_text(catalogue)}"


def categories_text(catalogue: Catalogue) -> str:
    """The categories, with how many modules each has."""
    categories = modules_of_category(catalogue).items()
    return f"Categories: {', '.join(f'{name} ({len(modules)})' for name, modules in categories)}."


def category_text(catalogue: Catalogue, category: str) -> str:
    """The modules of a category, a short line each.

    Raises:
        KeyError: there is no such category.
    """
    return "\n".join(module_in_short(module) for module in modules_of_category(catalogue)[category])


def module_text(module: Module, catalogue: Catalogue) -> str:
    """All that builders read about a module.

    Args:
        module: the module.
        catalogue: those that may be used, with or without their data sheets.
    """
    line = _module_lines(module, catalogue)
    if not module.faces or catalogue.data_sheets:
        return line
    # World-sized blocks have faces that their letters do not place.
    places = [f"{face.label} {point(face.center)}" for face in module.faces]
    up = "centre" if module.kind == "start" else "the face it sits on, z away from it"
    return f"{line}\nFaces, from {up}: {', '.join(places)}."


def modules_of_category(catalogue: Catalogue) -> dict[str, list[Module]]:
    """The modules that builders may use by category; one may be in several."""
    categories: dict[str, list[Module]] = {}
    for module in catalogue.values():
        if module.kind != "cargo":
            for category in module.categories or (OTHER,):
                categories.setdefault(category, []).append(module)
    return categories


def module_in_short(module: Module) -> str:
    """A module in a short line: its mass and what it is."""
    first = module.brief or module.description.partition(". ")[0]
    first = first.rstrip(".")
    return f"- {module.name} (mass {plain(module.mass)}): {first}."


def _chosen(catalogue: Catalogue, names: Collection[str] | None) -> Iterator[Module]:
    for module in catalogue.values():
        wanted = names is None or module.name in names
        if module.kind == "start" or (module.kind != "cargo" and wanted):
            yield module


def _size(module: Module) -> str:
    return "connector" if module.size is None else " x ".join(map(plain, module.size))


def _module_lines(module: Module, catalogue: Catalogue) -> str:
    facts = [_size(module), f"mass {plain(module.mass)}"]
    data = ""
    if catalogue.data_sheets:
        sheet = data_sheet(module, catalogue.start.physics)
        data = f"\n  Data: {sheet}." if sheet else ""
    elif module.faces:
        facts.append(f"faces {' '.join(face.label for face in module.faces)}")
    if module.actions:
        facts.append(f"actions {', '.join(module.actions)}")
    return f"{module.name} ({'; '.join(facts)}): {module.description}{data}"
