"""The sets of modules that a task can name."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache

from buildarena_geometry.modules.catalogue import basic_modules, extended_modules
from buildarena_geometry.modules.module import Catalogue, Module

MODULE_SETS = ("basic", "workshop", "all")


@cache
def module_set(name: str) -> Catalogue:
    """The modules of a set.

    Args:
        name: "basic" (the paper's modules), "workshop" (those, and every further type that both
            engines simulate, but those that tasks offer by name) or "all" (every type that can be
            built).

    Returns:
        The basic modules, then the further ones by their number in Besiege. Cargo, which no builder
        places, is in the basic set alone.

    Raises:
        ValueError: there is no such set.
    """
    if name not in MODULE_SETS:
        raise ValueError(f"there is no module set {name!r}; the sets are {', '.join(MODULE_SETS)}")
    if name == "basic":
        return Catalogue(basic_modules())
    built = [module for module in basic_modules() if module.kind != "cargo"]
    further = extended_modules()
    if name == "workshop":
        further = tuple(one for one in further if one.simulated and not one.by_name)
    return Catalogue((*built, *further))


def modules_named(chosen: str | Sequence[str] | None) -> tuple[str, ...]:
    """The names of the modules that a choice allows, the starting block and cargo left out.

    Args:
        chosen: a set's name, a list of modules' names, or None for the basic set.

    Raises:
        ValueError: there is no such set.
    """
    if chosen is not None and not isinstance(chosen, str):
        return tuple(chosen)
    catalogue = module_set(chosen or "basic")
    return (*catalogue.attachable, *catalogue.connectors)


def smallest_set(names: Iterable[str]) -> Catalogue:
    """The first of the sets that has all of these modules; the largest if none has.

    Args:
        names: modules' names.
    """
    wanted = set(names)
    for name in MODULE_SETS:
        # A ballast of the basic set is a task's cargo, which is no part of a machine.
        placed = {module.name for module in module_set(name).values() if module.kind != "cargo"}
        if wanted <= placed:
            return module_set(name)
    return module_set(MODULE_SETS[-1])


def modules_of_action(arguments: Mapping[str, object]) -> Iterator[Module]:
    """The modules that an action's arguments name.

    Args:
        arguments: as they were given, whether or not they were right.
    """
    for argument in ("new_block", "connector"):
        written = arguments.get(argument)
        module = module_set("all").named(written) if isinstance(written, str) else None
        if module is not None:
            yield module


@cache
def simulated_modules() -> Catalogue:
    """The modules that a task can offer by name: all that both engines simulate."""
    return Catalogue(tuple(module for module in module_set("all").values() if module.simulated))


@cache
def catalogue_of(chosen: str | tuple[str, ...] | None) -> Catalogue:
    """The modules that machines are built from where a choice is made.

    A list of basic modules leaves a machine all of them, as it always did: what it is made of is
    checked when it is handed in.

    Args:
        chosen: a set's name, modules' names, or None for the basic set.

    Raises:
        ValueError: there is no such set or module.
    """
    if chosen is None or isinstance(chosen, str):
        return module_set(chosen or "basic")
    known = module_set("all")
    unknown = [name for name in chosen if name not in known]
    if unknown:
        raise ValueError(f"there is no module {unknown[0]!r}; the modules are {', '.join(known)}")
    if set(chosen) <= {*modules_named("basic"), known.start.name}:
        return module_set("basic")
    wanted = {*chosen, known.start.name}
    return Catalogue(tuple(module for name, module in known.items() if name in wanted))
