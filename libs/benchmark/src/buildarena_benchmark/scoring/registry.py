"""The scorers by name: modules with a `SCORER` here and in categories, and other distributions'.

A distribution adds one by an entry point in the group `buildarena.scorers`.
"""

import pkgutil
from collections.abc import Mapping
from functools import cache, reduce
from importlib import import_module, metadata
from operator import or_
from types import MappingProxyType
from typing import Annotated, Any, Final

from pydantic import Field

from buildarena_benchmark import scoring
from buildarena_benchmark.categories import categories
from buildarena_benchmark.scoring.flags import REFUTED, UNSTABLE, Flag
from buildarena_benchmark.scoring.scorer import Scorer

GROUP: Final = "buildarena.scorers"
_NO_SCORERS: Final = {"registry", "expert"}
"""Modules without a scorer that need the scorers to be registered."""


@cache
def known_scorers() -> Mapping[str, Scorer]:
    """Return all scorers by name: ours in the order of their names, then other distributions'.

    Raises:
        ValueError: Two scorers have one name, or two flags do that differ.
    """
    folders = [import_module(category.package) for category in categories()]
    modules = [
        import_module(f"{folder.__name__}.{module.name}")
        for folder in (scoring, *folders)
        for module in pkgutil.iter_modules(folder.__path__)
        if not module.ispkg and module.name not in _NO_SCORERS
    ]
    listed = [module.SCORER for module in modules if hasattr(module, "SCORER")]
    listed.sort(key=lambda scorer: scorer.name)
    listed += [point.load() for point in metadata.entry_points(group=GROUP)]
    by_name: dict[str, Scorer] = {}
    for scorer in listed:
        if by_name.setdefault(scorer.name, scorer) is not scorer:
            raise ValueError(f"two scorers are called {scorer.name!r}")
    return MappingProxyType(by_name)


@cache
def known_flags() -> Mapping[str, Flag]:
    """Return all flags that scores can have, by name: those that disqualify first.

    Raises:
        ValueError: Two scorers mean different things by one flag.
    """
    flags: dict[str, Flag] = {}
    raised = [flag for scorer in known_scorers().values() for flag in scorer.flags]
    for flag in sorted([*raised, UNSTABLE, REFUTED], key=lambda flag: not flag.disqualifying):
        if flags.setdefault(flag.name, flag) != flag:
            raise ValueError(f"two flags are called {flag.name!r}")
    return MappingProxyType(flags)


def scoring_type() -> Any:
    """Return the type of `scoring` in task files: the union of all scorers' parameters, by name."""
    union = reduce(or_, (scorer.parameters for scorer in known_scorers().values()))
    return Annotated[union, Field(discriminator="name")]
