"""Points where a script measures the ground to check that the right level is open.

A script sends rays down next to the machine. The points are chosen so that the flat sandbox and the
gaps of built-in bridges differ at some of them; a scenario with terrain adds the middles of its
boxes and both sides of their edges.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from buildarena_simulation import Scenario
from buildarena_simulation.scenario import TerrainBox

MAX_PROBES: Final = 40
"""Maximum number of probes, so that their line is not longer than a sample's."""

RAY_ABOVE: Final = 20.0
"""Height at which a ray begins above the highest terrain, units."""

_EASTS: Final = (-12.0, 12.0)
_NORTHS: Final = (-25.0, -12.0, -7.0, -3.75, 0.0, 3.75, 7.0, 12.0, 25.0)
"""North coordinates clear of machines, on both sides of the edges of gaps of 5 to 45 units."""

_COURSES: Final = tuple((east, north) for north in (9.0, 20.0) for east in (-9.0, 9.0))
"""Points where built-in courses have walls and plateaus."""

_CLEAR_OF_EDGES: Final = 0.6
"""Distance from an edge within which a height is ignored, as it may be either side's, units."""

_BESIDE_EDGES: Final = 1.25
"""Distance from an edge at which the ground is measured on either side, units."""

_ASIDE: Final = 0.4
"""Distance from a box's middle, as a share of its width: bridges are narrow."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Probe:
    """A point where the ground's height is known.

    Attributes:
        east: World frame, units.
        north: World frame, units.
        height: Height of the terrain, or of the ground at 0, units.
    """

    east: float
    north: float
    height: float


def level_probes(scenario: Scenario) -> tuple[Probe, ...]:
    """Return the points at which a trial measures its level, in the order of its report.

    Args:
        scenario: Scenario with the terrain; without any, the ground is flat.
    """
    terrain = scenario.terrain
    grid = [(east, north) for north in _NORTHS for east in _EASTS]
    places = dict.fromkeys(grid if terrain else [*grid, *_COURSES], _CLEAR_OF_EDGES)
    for box in terrain:
        half = min(box.size[:2]) / 2
        places.setdefault((box.center[0], box.center[1]), min(_CLEAR_OF_EDGES, half / 2))
    for box in terrain:
        east = box.center[0] + _ASIDE * box.size[0]
        for north in _beside_edges(box):
            places.setdefault((east, north), _CLEAR_OF_EDGES)
    probes = (
        Probe(east=east, north=north, height=height_at(terrain, east, north))
        for (east, north), margin in places.items()
        if _clear(terrain, east, north, margin)
    )
    return tuple(itertools.islice(probes, MAX_PROBES))


def ray_start(scenario: Scenario) -> float:
    """Return the height at which a trial's rays begin, units."""
    highest = max((probe.height for probe in level_probes(scenario)), default=0.0)
    return highest + RAY_ABOVE


def height_at(terrain: tuple[TerrainBox, ...], east: float, north: float) -> float:
    """Return the height of the uppermost terrain at a point, 0 for the ground; units."""
    return max((top for box in terrain for top in _tops(box, east, north)), default=0.0)


def _tops(box: TerrainBox, east: float, north: float) -> Iterator[float]:
    """Yield the top of a box on a vertical line; nothing if the line misses the box."""
    if abs(east - box.center[0]) > box.size[0] / 2:
        return
    turn = math.radians(box.slope_deg)
    ahead = north - box.center[1]
    # In the box's own axes the line is (n, u) = ahead·(cos, -sin) + h·(sin, cos).
    across, along = ahead * math.cos(turn), -ahead * math.sin(turn)
    low, high = -math.inf, math.inf
    for start, step, half in (
        (across, math.sin(turn), box.size[1] / 2),
        (along, math.cos(turn), box.size[2] / 2),
    ):
        if abs(step) < 1e-9:  # noqa: PLR2004 - the line runs along these faces
            if abs(start) > half:
                return
            continue
        ends = sorted(((-half - start) / step, (half - start) / step))
        low, high = max(low, ends[0]), min(high, ends[1])
    if low <= high:
        yield box.center[2] + high


def _beside_edges(box: TerrainBox) -> Iterator[float]:
    """Yield points on both sides of a box's southern and northern edge."""
    for edge in (-1.0, 1.0):
        for offset in (-_BESIDE_EDGES, _BESIDE_EDGES):
            yield box.center[1] + edge * box.size[1] / 2 + offset


def _clear(terrain: tuple[TerrainBox, ...], east: float, north: float, margin: float) -> bool:
    """Check if the ground near a point is free of edges."""
    own = height_at(terrain, east, north)
    offsets = itertools.product((-margin, 0.0, margin), repeat=2)
    return all(
        abs(height_at(terrain, east + aside, north + ahead) - own) <= 2 * margin
        for aside, ahead in offsets
    )
