"""Share of a way there and back that a subject was driven."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from buildarena_benchmark.scoring.measures.components import Mask
from buildarena_benchmark.scoring.measures.series import Series


@dataclass(frozen=True, slots=True, kw_only=True)
class Route:
    """Progress on a way to a place and back.

    Attributes:
        way: Approach of the subject to the place, and from its arrival there on to its start,
            units.
        arrival: First sample there; None if it never was.
        back: First sample back after that; None if it never was.
    """

    way: float
    arrival: int | None
    back: int | None


def there_and_back(
    path: Series, target: Series, reach: float, counts: Callable[[int], Mask]
) -> Route:
    """Return how much of the way to a target and back a path is.

    Args:
        path: (T, 2) or (T, 3) of the subject, units.
        target: (2,) place, units.
        reach: Largest distance that counts as there, and back, units.
        counts: Called with a sample: (T,) bool, whether the subject counts as driven since it.
    """
    length = float(np.linalg.norm(target - path[0, :2]))
    nearest, arrival = _approach(path, target, reach, counts(0), since=0)
    way = max(length - nearest, 0.0)
    if arrival is None:
        return Route(way=way, arrival=None, back=None)
    begun = float(np.linalg.norm(path[arrival, :2] - path[0, :2]))
    nearest, back = _approach(path, path[0, :2], reach, counts(arrival), since=arrival)
    return Route(way=way + max(begun - nearest, 0.0), arrival=arrival, back=back)


def _approach(
    path: Series, place: Series, reach: float, counts: Mask, *, since: int
) -> tuple[float, int | None]:
    """Return a path's nearest distance to a place from a sample on, and its first within reach."""
    distances = np.linalg.norm(path[:, :2] - place, axis=1)
    distances[~counts] = np.inf
    distances[:since] = np.inf
    within = np.flatnonzero(distances <= reach)
    return float(distances.min()), int(within[0]) if len(within) else None
