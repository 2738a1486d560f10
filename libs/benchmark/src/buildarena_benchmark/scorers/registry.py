"""The scorers by name: each module of this folder that has a `SCORER`, and other distributions'.

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

from buildarena_benchmark import scorers
from buildarena_benchmark.scorers.scorer import REFUTED, UNSTABLE, Flag, Scorer

GROUP: Final = "buildarena.scorers"


@cache
def known_scorers() -> Mapping[str, Scorer]:
    """All scorers by name: ours in the order of their names, then those of other distributions.

    Raises:
        ValueError: Two scorers have one name, or two flags do that differ.
    """
    names = sorted(module.name for module in pkgutil.iter_modules(scorers.__path__))
    modules = [import_module(f"{scorers.__name__}.{name}") for name in names if name not in _PARTS]
    listed = [module.SCORER for module in modules if hasattr(module, "SCORER")]
    listed += [point.load() for point in metadata.entry_points(group=GROUP)]
    by_name: dict[str, Scorer] = {}
    for scorer in listed:
        if by_name.setdefault(scorer.name, scorer) is not scorer:
            raise ValueError(f"two scorers are called {scorer.name!r}")
    return MappingProxyType(by_name)


@cache
def known_flags() -> Mapping[str, Flag]:
    """All flags that scores can have, by name: those that disqualify first.

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
    """What a task file may say under `scoring`: the union of all scorers' parameters, by name."""
    union = reduce(or_, (scorer.parameters for scorer in known_scorers().values()))
    return Annotated[union, Field(discriminator="name")]


_PARTS: Final = {"measures", "registry", "scorer"}
