"""The sets of modules that a task can name."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from buildarena_geometry.modules.catalogue import basic_modules, extended_modules
from buildarena_geometry.modules.module import Catalogue

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence

MODULE_SETS = ("basic", "workshop", "all")


@cache
def module_set(name: str) -> Catalogue:
    """The modules of a set.

    Args:
        name: "basic" (the paper's modules), "workshop" (those, and every further type that both
            engines simulate) or "all" (every type that can be built).

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
    further = [one for one in extended_modules() if name == "all" or one.facts.simulated]
    return Catalogue((*built, *further))


def smallest_set(names: Collection[str]) -> Catalogue:
    """The first set that knows all of some modules, as far as any does.

    Args:
        names: modules' names; those that no set knows are passed over.
    """
    known = [name for name in names if name in module_set("all")]
    return next(one for one in map(module_set, MODULE_SETS) if all(_builds(one, known)))


def _builds(catalogue: Catalogue, names: Collection[str]) -> Iterator[bool]:
    return (name in catalogue and catalogue[name].kind != "cargo" for name in names)


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


@cache
def catalogue_of(chosen: str | tuple[str, ...] | None) -> Catalogue:
    """The modules that a choice allows, as machines are built from them.

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
    return Catalogue((known.start, *(known[name] for name in chosen if name != known.start.name)))
