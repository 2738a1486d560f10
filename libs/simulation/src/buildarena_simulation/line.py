"""A closed line on the ground, which a machine may follow and sense from above."""

from functools import lru_cache
from typing import Annotated, Final, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator

Radius = Annotated[float, Field(ge=1, le=1000)]
Width = Annotated[float, Field(ge=0.05, le=10)]
Bend = Annotated[float, Field(allow_inf_nan=False, ge=-0.5, le=0.5)]
Reach = Annotated[float, Field(allow_inf_nan=False, ge=-20, le=20)]
Side = Annotated[float, Field(allow_inf_nan=False, ge=-1, le=1)]

SENSORS: Final = ("left", "middle", "right")
"""The ground sensors, from left to right."""
_MOST_BENT: Final = 0.5
_FINE: Final = 20_000
"""Number of angles at which the line is sampled."""
_REMEMBERED: Final = 8
"""Number of cached lines, 0.6 MB each: every randomized scenario has its own."""
_FIRST_BEND: Final = 2
"""Waves of the first bend: one wave would only shift the circle."""


class Line(BaseModel):
    """A closed line that begins at (0, 0) towards the north and cannot be touched.

    It is a circle with waves: at the angle a its distance from its centre is
    radius x (1 + the sum, over bends k from 2 on, of c cos(k a) + s sin(k a)), and it begins at
    a = 0, after which it bends to the left.

    Attributes:
        radius: Radius of the circle, units.
        bends: (c, s) of each bend, shares of the radius; the first has two waves, the next three.
        side: Negative if the line is mirrored and bends to the right.
        half_width: Distance from its middle to either edge, units.
        ahead: Distance of the ground sensors from the starting block's centre, towards its north as
            built, units.
        apart: Distance of the outer sensors from the middle one, units.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    radius: Radius
    bends: Annotated[tuple[tuple[Bend, Bend], ...], Field(max_length=6)] = ()
    side: Side = 1.0
    half_width: Width = 0.5
    ahead: Reach = 1.5
    apart: Reach = 0.6

    @model_validator(mode="after")
    def _goes_round_once(self) -> Self:
        bent = sum(abs(share) for bend in self.bends for share in bend)
        if bent > _MOST_BENT:
            raise ValueError(f"the bends' shares are {bent:g} in all; the most is {_MOST_BENT:g}")
        return self

    @property
    def length(self) -> float:
        """All the way round, units."""
        return _measured(self)[2]

    def points(self, count: int) -> NDArray[np.float64]:
        """Return points at even distances along the line, from (0, 0) on, (count, 2), units."""
        path, ways, length = _measured(self)
        at = np.arange(count) * length / count
        return np.column_stack([np.interp(at, ways, path[:, axis]) for axis in (0, 1)])

    def nearest(self, places: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
        """Return the nearest points of the line, and the distances from it.

        Args:
            places: (T, 2) or (T, 3), world frame, units; heights are ignored.

        Returns:
            The way along the line to its nearest point, (T,), from 0 on and below the length, and
            the level distance from there, (T,), units.
        """
        path, ways, _ = _measured(self)
        own = np.atleast_2d(places)[:, :2].astype(np.float64)
        # The nearest point lies near the angle about the centre, where the search starts.
        nodes = path[:: _FINE // _NODES]
        coarse = np.linalg.norm(own[:, None] - nodes[None], axis=2).argmin(axis=1)
        around = np.arange(-_FINE // _NODES, _FINE // _NODES + 1)
        rows = (coarse[:, None] * (_FINE // _NODES) + around) % _FINE
        distance = np.linalg.norm(own[:, None] - path[rows], axis=2)
        best = distance.argmin(axis=1)
        each = np.arange(len(own))
        return ways[rows[each, best]], distance[each, best]


_NODES: Final = 200


@lru_cache(maxsize=_REMEMBERED)
def _measured(line: Line) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Return points of a line, (F, 2), their distances along it, (F + 1,) units, and its length."""
    angle = np.arange(_FINE + 1) * 2 * np.pi / _FINE
    away, slope = np.ones(_FINE + 1), np.zeros(_FINE + 1)
    for k, (c, s) in enumerate(line.bends, start=_FIRST_BEND):
        even, odd = np.cos(k * angle), np.sin(k * angle)
        away += c * even + s * odd
        slope += k * (s * even - c * odd)
    around = line.radius * away[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    # What is the way at the start becomes north.
    turn = np.pi / 2 - np.arctan2(away[0], slope[0])
    cosine, sine = np.cos(turn), np.sin(turn)
    path = (around - around[0]) @ np.array([[cosine, sine], [-sine, cosine]])
    if line.side < 0:
        path[:, 0] *= -1
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
    ways = np.concatenate([[0.0], np.cumsum(steps)])
    return path, ways, float(ways[-1])
