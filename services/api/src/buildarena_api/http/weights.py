"""What questions weigh: how many of the lightest ones they are worth.

A route says with `weighs` what it is worth; one that says nothing weighs 1. The weight is known
from method, path and query alone, so that it is found at the door, before a key is looked up. It is
taken from the caller's rate, and all that weighs more than 1 goes through a narrow lane.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final, TypeVar

from fastapi.routing import APIRoute
from starlette.datastructures import QueryParams
from starlette.types import Scope

from buildarena_api.http.methods import path_pattern

WEIGHT: Final = "buildarena.weight"
"""Where a request's scope has its `Weight`."""
MAX_QUERY_BYTES: Final = 4096
"""Of a longer query, which none of our clients sends, nothing is read here."""
HEAVIEST: Final = 20
"""What a question weighs that can't be judged."""
ROWS_EACH: Final = 100
"""Rows that a unit of weight brings."""

Query = Mapping[str, str]
Weigh = Callable[[Query], int]
Endpoint = TypeVar("Endpoint", bound=Callable[..., Any])


@dataclass(frozen=True, slots=True, kw_only=True)
class Weight:
    """What one question weighs.

    Attributes:
        units: In questions of the lightest kind.
        lane: The field of `ConcurrencyLimits` that it takes its place in.
    """

    units: int
    lane: str

    @property
    def is_light(self) -> bool:
        """Whether it weighs no more than any question does."""
        return self.units == 1


LIGHT: Final = Weight(units=1, lane="ordinary")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Declared:
    weigh: int | Weigh
    lane: str


_declared: dict[Callable[..., Any], _Declared] = {}


def weighs(units: int | Weigh, *, lane: str = "heavy") -> Callable[[Endpoint], Endpoint]:
    """Declares what a route's questions weigh; it stands below the route's own decorator.

    Args:
        units: Their weight, or what it is for a query.
        lane: The field of `ConcurrencyLimits` for those that weigh more than 1.
    """

    def declare(endpoint: Endpoint) -> Endpoint:
        _declared[endpoint] = _Declared(weigh=units, lane=lane)
        return endpoint

    return declare


def rows(query: Query, *, default: int, each: int = ROWS_EACH) -> int:
    """What the rows weigh that a query may bring by its `limit`.

    Args:
        query: The query.
        default: The limit of a query without one.
        each: Rows that weigh 1.
    """
    given = query.get("limit", str(default))
    # Whatever else a number may be spelled like is not worth reading here.
    if not (given.isascii() and given.isdecimal()):
        return HEAVIEST
    return min(HEAVIEST, 1 + max(0, int(given) - 1) // each)


class Weights:
    """Weighs requests.

    Args:
        routes: The routes of the application; the order plays no part.
    """

    def __init__(self, routes: Iterable[APIRoute]) -> None:
        self._routes = [
            (path_pattern(route.path), frozenset(route.methods or ()), declared)
            for route in routes
            if (declared := _declared.get(route.endpoint)) is not None
        ]

    def of(self, scope: Scope) -> Weight:
        """What a request weighs."""
        for pattern, methods, declared in self._routes:
            if scope["method"] in methods and pattern.fullmatch(scope["path"]):
                units = _units(declared.weigh, scope["query_string"])
                return LIGHT if units == 1 else Weight(units=units, lane=declared.lane)
        return LIGHT


def weight_of(scope: Scope) -> Weight:
    """What was found of a request at the door."""
    weight: Weight = scope.get(WEIGHT, LIGHT)
    return weight


def _units(weigh: int | Weigh, query: bytes) -> int:
    if not callable(weigh):
        return weigh
    if len(query) > MAX_QUERY_BYTES:
        return HEAVIEST
    return weigh(QueryParams(query))
