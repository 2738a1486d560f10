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
        way: How much nearer the subject came to the place, and from when it got there on to its
            start, units.
        there: The first sample at which it was there; None if it never was.
        back: The first sample after that at which it was back; None if it never was.
    """

    way: float
    there: int | None
    back: int | None


def there_and_back(
    path: Series, target: Series, reach: float, counts: Callable[[int], Mask]
) -> Route:
    """Return how much of the way to a target and back a path is.

    Args:
        path: (T, 2) or (T, 3) of the subject, units.
        target: (2,) where to go, units.
        reach: How near is there, and back, units.
        counts: At which samples (T,) the subject counts as driven, since a sample.
    """
    length = float(np.linalg.norm(target - path[0, :2]))
    nearest, there = _approach(path, target, reach, counts(0), since=0)
    way = max(length - nearest, 0.0)
    if there is None:
        return Route(way=way, there=None, back=None)
    begun = float(np.linalg.norm(path[there, :2] - path[0, :2]))
    nearest, back = _approach(path, path[0, :2], reach, counts(there), since=there)
    return Route(way=way + max(begun - nearest, 0.0), there=there, back=back)


def _approach(
    path: Series, place: Series, reach: float, counts: Mask, *, since: int
) -> tuple[float, int | None]:
    """Return how near a path comes to a place from a sample on, and when first within reach."""
    apart = np.linalg.norm(path[:, :2] - place, axis=1)
    apart[~counts] = np.inf
    apart[:since] = np.inf
    within = np.flatnonzero(apart <= reach)
    return float(apart.min()), int(within[0]) if len(within) else None
