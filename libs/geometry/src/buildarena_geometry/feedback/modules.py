"""The modules in words: what a builder may use."""

from collections.abc import Callable, Collection, Iterator, Mapping
from types import MappingProxyType

from buildarena_geometry.feedback.data_sheets import data_sheet, faces_of
from buildarena_geometry.feedback.words import counted, plain
from buildarena_geometry.modules.module import Catalogue, Module

OTHER = "other"  # the category of modules that name none


def modules_text(catalogue: Catalogue, names: Collection[str] | None = None) -> str:
    """Describe the modules for people and models, a line each: size, mass and purpose.

    The lines include data if the catalogue has data sheets. Faces equal to an earlier line's are
    not repeated.

    Args:
        names: modules to describe besides the starting block. Defaults to all that can be built.
    """
    known_faces: dict[str, str] = {}
    lines = []
    for module in _select(catalogue, names):
        lines.append(f"- {module_text(module, catalogue, known_faces)}")
        known_faces.setdefault(faces_of(module), module.name)
    return "\n".join(lines)


def modules_in_short(catalogue: Catalogue, names: Collection[str] | None = None) -> str:
    """Describe the modules without letters and descriptions, for roles that work from a drawing.

    Args:
        names: see `modules_text`.
    """
    lines = []
    for module in _select(catalogue, names):
        actions = f", does {', '.join(module.actions)}" if module.actions else ""
        lines.append(f"- {module.name}: {_size(module)}, mass {plain(module.mass)}{actions}")
    return "\n".join(lines)


def lookup_text(catalogue: Catalogue) -> str:
    """Return the text that replaces the modules for builders that look modules up."""
    count = sum(module.kind not in ("start", "cargo") for module in catalogue.values())
    usage = "list_modules names those of a category, describe_module tells all about one or several"
    used = f"{counted(count, 'module')} may be used. Look up what you need: {usage}."
    return f"{used}\n{categories_text(catalogue)}"


def categories_text(catalogue: Catalogue) -> str:
    """List the categories, with the number of modules in each."""
    categories = modules_of_category(catalogue).items()
    return f"Categories: {', '.join(f'{name} ({len(modules)})' for name, modules in categories)}."


def category_text(catalogue: Catalogue, category: str) -> str:
    """List the modules of a category, a short line each.

    Raises:
        KeyError: the category is unknown.
    """
    return "\n".join(module_in_short(module) for module in modules_of_category(catalogue)[category])


def modules_of_category(catalogue: Catalogue) -> dict[str, list[Module]]:
    """Return the modules that builders may use by category; one may be in several."""
    categories: dict[str, list[Module]] = {}
    for module in catalogue.values():
        if module.kind != "cargo":
            for category in module.categories or (OTHER,):
                categories.setdefault(category, []).append(module)
    return categories


def module_in_short(module: Module) -> str:
    """Describe a module in a short line: its mass and purpose."""
    return f"- {module.name} (mass {plain(module.mass)}): {module.description}"


def _select(catalogue: Catalogue, names: Collection[str] | None) -> Iterator[Module]:
    for module in catalogue.values():
        is_selected = names is None or module.name in names
        if module.kind == "start" or (module.kind != "cargo" and is_selected):
            yield module


def _size(module: Module) -> str:
    return "connector" if module.size is None else "x".join(map(plain, module.size))


def module_text(
    module: Module, catalogue: Catalogue, earlier: Mapping[str, str] = MappingProxyType({})
) -> str:
    """Return all that builders read about a module, in a line.

    Args:
        catalogue: modules that may be used, with or without their data sheets.
        earlier: modules of earlier lines by their faces, which are not repeated.
    """
    facts = [_size(module), f"mass {plain(module.mass)}"]
    if module.actions:
        facts.append(f"actions {', '.join(map(_action(module), module.actions))}")
    if module.spins:
        facts.append("can be flipped")
    parts = [module.description]
    sheet = data_sheet(module, catalogue.start.physics) if catalogue.data_sheets else ""
    if sheet:
        parts.append(f"{sheet[0].upper()}{sheet[1:]}.")
    faces = faces_of(module)
    if faces:
        parts.append(f"Faces {f'as {earlier[faces]}' if faces in earlier else faces}.")
    return f"{module.name} ({', '.join(facts)}): {' '.join(parts)}"


def _action(module: Module) -> Callable[[str], str]:
    """Return a function that formats an action and marks the forward one."""
    drive = None if module.joint is None else module.joint.drive
    forward = None if drive is None else drive.forward
    return lambda name: f"{name} (forward)" if name == forward else name
