"""The sets of modules that a task can name."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache

from buildarena_geometry.modules.catalogue import basic_modules, extended_modules
from buildarena_geometry.modules.module import Catalogue, Module

MODULE_SETS = ("basic", "workshop", "all")


@cache
def module_set(name: str) -> Catalogue:
    """Return the modules of a set.

    Args:
        name: "basic" (the paper's modules), "workshop" (those, and every further type that both
            engines simulate, except those that tasks offer by name) or "all" (every type that can
            be built).

    Returns:
        The basic modules, then the further ones by their number in Besiege. Cargo, which no builder
        places, is in the basic set alone.

    Raises:
        ValueError: the set is unknown.
    """
    if name not in MODULE_SETS:
        raise ValueError(f"unknown module set {name!r}; valid sets: {', '.join(MODULE_SETS)}")
    if name == "basic":
        return Catalogue(basic_modules())
    built = [module for module in basic_modules() if module.kind != "cargo"]
    extension = extended_modules()
    if name == "workshop":
        extension = tuple(entry for entry in extension if entry.simulated and not entry.by_name)
    return Catalogue((*built, *extension))


def modules_named(chosen: str | Sequence[str] | None) -> tuple[str, ...]:
    """Return the names of the modules that a choice allows, without starting block and cargo.

    Args:
        chosen: a set's name, a list of modules' names, or None for the basic set.

    Raises:
        ValueError: the set is unknown.
    """
    if chosen is not None and not isinstance(chosen, str):
        return tuple(chosen)
    catalogue = module_set(chosen or "basic")
    return (*catalogue.attachable, *catalogue.connectors)


def smallest_set(names: Iterable[str]) -> Catalogue:
    """Return the first of the sets that has all of these modules; the largest if none has."""
    required = set(names)
    for name in MODULE_SETS:
        # A ballast of the basic set is a task's cargo, not a part of a machine.
        placed = {module.name for module in module_set(name).values() if module.kind != "cargo"}
        if required <= placed:
            return module_set(name)
    return module_set(MODULE_SETS[-1])


def modules_of_action(arguments: Mapping[str, object]) -> Iterator[Module]:
    """Yield the modules that an action's arguments name.

    Args:
        arguments: arguments as received, valid or not.
    """
    for argument in ("new_block", "connector"):
        written = arguments.get(argument)
        module = module_set("all").named(written) if isinstance(written, str) else None
        if module is not None:
            yield module


@cache
def simulated_modules() -> Catalogue:
    """Return the modules that a task can offer by name: all that both engines simulate."""
    return Catalogue(tuple(module for module in module_set("all").values() if module.simulated))


@cache
def catalogue_of(chosen: str | tuple[str, ...] | None) -> Catalogue:
    """Return the modules that a choice allows machines to be built from.

    A list of basic modules leaves a machine all of them, because its parts are
    checked when it is submitted.

    Args:
        chosen: a set's name, modules' names, or None for the basic set.

    Raises:
        ValueError: the set or a module is unknown.
    """
    if chosen is None or isinstance(chosen, str):
        return module_set(chosen or "basic")
    modules = module_set("all")
    unknown = [name for name in chosen if name not in modules]
    if unknown:
        raise ValueError(f"unknown module {unknown[0]!r}; valid modules: {', '.join(modules)}")
    if set(chosen) <= {*modules_named("basic"), modules.start.name}:
        return module_set("basic")
    selected = {*chosen, modules.start.name}
    return Catalogue(tuple(module for name, module in modules.items() if name in selected))
