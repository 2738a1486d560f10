"""Spans of bridges: how long the cargo is carried, and where its load goes."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from buildarena_benchmark.scoring.measures.components import groups_of, spans_of
from buildarena_benchmark.scoring.measures.outline import extents
from buildarena_benchmark.scoring.measures.run import Run
from buildarena_benchmark.scoring.measures.series import gravity_of
from buildarena_simulation import Scenario
from buildarena_simulation.scenario import SpanPlacement, TerrainBox
from buildarena_simulation.terrain import shape_of

MAX_ON_FLOOR: Final = 0.1
"""Largest share of the vertical force that may act on the gap's floor."""

MAX_GROWTH_ON_FLOOR: Final = 0.2
"""Largest share of a growing load that the floor may take up, however heavy the machine is."""

MIN_ON_TERRAIN: Final = 0.01
"""Smallest share of the vertical force that must act on each side's terrain."""

MIN_GROWTH: Final = 0.05
"""Smallest share of a growing load that each side's terrain must take up: dead weight that lies on
a terrain next to the machine takes up nothing."""

MIN_CARRIED: Final = 0.9
"""Smallest share of the force that holds the cargo up that must come from the machine."""

COLLAPSE_S: Final = 1.5
"""A bridge that gives way may be in pieces for so long before the cargo is lost, seconds: what
carries the load from then on does not count. At most half of the time it carried it."""

MAX_ASIDE: Final = 1.0
"""Largest distance of a cargo from the gap's middle, units, towards either terrain."""

MAX_ASIDE_SHARE: Final = 1.0 / 8.0
"""The same as a share of the gap, where that is more: a bridge carries more near its ends."""

_REACHES: Final = 0.25
"""Largest distance to a terrain's edge, units, at which a part may rest on it or its side."""

_EDGE = 1e-6

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Span:
    """Shares of the load by support, summed over the time the cargo was carried.

    Attributes:
        floor: The floor's share of the vertical force on the machine, until a collapse begins.
        least_terrain: The share of the side whose terrain carried less, likewise.
        floor_growth: Share of each additional unit of load that the floor carries, before a
            collapse.
        least_growth: The same share for the side that carries less.
        carried: The machine's share of the force that held the cargo up.
    """

    floor: float
    least_terrain: float
    floor_growth: float
    least_growth: float
    carried: float

    @property
    def spans(self) -> bool:
        """True if the load went to both terrains."""
        return (
            self.floor <= MAX_ON_FLOOR
            and self.floor_growth <= MAX_GROWTH_ON_FLOOR
            and self.least_terrain >= MIN_ON_TERRAIN
            and self.least_growth >= MIN_GROWTH
            and self.carried >= MIN_CARRIED
        )


def deciding_sample(run: Run, *, fall_height: float) -> int | None:
    """Return the first sample at which the cargo is not carried any more; None if it always is.

    From then on its centre is below the fall height, or too far from the gap's middle: what is
    carried near a terrain, or lies on it, is not carried over the gap.

    Args:
        run: Has a cargo.
        fall_height: Units.
    """
    lost = np.flatnonzero(is_lost(run.scenario, run.cargo_path, fall_height=fall_height))
    return int(lost[0]) if len(lost) else None


def is_lost(
    scenario: "Scenario", position: NDArray[np.floating], *, fall_height: float
) -> NDArray[np.bool_]:
    """Return when a cargo at these positions (T, 3) is not carried over the gap, (T,)."""
    at = position.astype(np.float64)
    lost = ~(at[:, 2] >= fall_height)
    if isinstance(scenario.placement, SpanPlacement):
        lost |= np.abs(at[:, 1]) > max_aside(scenario.placement.gap) + _EDGE
    return np.asarray(lost)


def max_aside(gap: float) -> float:
    """Return how far towards a terrain the cargo's centre may be from the gap's middle, units."""
    return min(max(MAX_ASIDE, MAX_ASIDE_SHARE * gap), gap / 2)


def collapsed_sample(run: Run) -> int | None:
    """Return the first sample at which no part in one piece spans from terrain to terrain any more.

    None where one always does, none ever did, or that is not known.
    """
    groups = groups_of(run.machine, run.trajectory)
    placement = run.scenario.placement
    if groups is None or not groups.shape[1] or not isinstance(placement, SpanPlacement):
        return None
    edge = placement.gap / 2 - _REACHES
    low, high = extents(run, axis=1)
    south, north = low <= -edge, high >= edge
    spans = np.zeros(len(groups), dtype=bool)
    for first, last in spans_of(groups):
        for group in np.unique(groups[first]):
            members = groups[first] == group
            rows = slice(first, last)
            spans[rows] |= south[rows][:, members].any(axis=1) & north[rows][:, members].any(axis=1)
    if not spans.any():
        return None
    lost = np.flatnonzero(~spans[spans.argmax() :])
    return int(spans.argmax() + lost[0]) if len(lost) else None


def measure_span(run: Run, decided: int | None) -> Span | None:
    """Return where the load went until it was decided; None where that is not defined.

    It is not where the scenario has no gap between terrains, or where the trajectory has no
    contact forces.

    Args:
        run: Has a cargo.
        decided: Result of `deciding_sample`; debris of a collapsed bridge is included too.
    """
    bearing, sides = run.trajectory.bearing, terrain_sides(run.scenario)
    if bearing is None or sides is None:
        return None
    until = len(run.time_s) if decided is None else decided + 1
    last = _stable_end(run.time_s, bearing.cargo, decided)
    stable, intact = slice(last), slice(_first_break(run, last, until))
    ground = bearing.ground[:until].astype(np.float64)
    terrain = bearing.terrain[:until].astype(np.float64)
    load = bearing.cargo[:until].astype(np.float64)
    total = max(float(ground[intact].sum() + terrain[intact].sum()), 0.0)
    sums = [float(terrain[intact][:, side].sum()) for side in sides]
    growths = [_growth(terrain[stable][:, side].sum(axis=1), load[stable]) for side in sides]
    return Span(
        floor=_share(float(ground[intact].sum()), total),
        least_terrain=_share(min(sums), total),
        floor_growth=_growth(ground[stable], load[stable]),
        least_growth=min(growths),
        carried=_share(float(load[1:].sum()), _needed(run, until)),
    )


def _stable_end(time_s: NDArray[np.float64], load: NDArray[np.float32], decided: int | None) -> int:
    """Return how many samples there are before a collapse."""
    if decided is None:
        return len(time_s)
    touching = np.flatnonzero(load[: decided + 1] > 0.0)
    carried_s = float(time_s[decided] - time_s[touching[0]]) if len(touching) else 0.0
    ended_s = float(time_s[decided]) - min(COLLAPSE_S, carried_s / 2)
    return int(np.searchsorted(time_s, ended_s, side="right"))


def _first_break(run: Run, standing: int, until: int) -> int:
    """Return how many samples there are before the break that starts a collapse, if one does.

    Args:
        standing: Samples before a collapse may begin.
        until: Samples until the load is decided.
    """
    if standing >= until:
        return until
    times = [b.time_s for b in run.trajectory.breaks if b.time_s >= run.time_s[standing]]
    return min(int(np.searchsorted(run.time_s, min(times, default=np.inf))), until)


def terrain_sides(scenario: "Scenario") -> tuple[list[int], list[int]] | None:
    """Return the terrain boxes south and north of the gap; None unless both have some.

    Boxes in the gap are part of the scenario and belong to neither side.
    """
    if not isinstance(scenario.placement, SpanPlacement):
        return None
    edge = scenario.placement.gap / 2 - _EDGE
    reach = [
        (box.center[1] - reach, box.center[1] + reach)
        for box, reach in ((box, _reach(box)) for box in scenario.terrain)
    ]
    south = [i for i, (_, high) in enumerate(reach) if high <= -edge]
    north = [i for i, (low, _) in enumerate(reach) if low >= edge]
    return (south, north) if south and north else None


def _reach(box: TerrainBox) -> float:
    """Return how far a terrain box reaches to the north and south of its centre, units."""
    return float(shape_of(box).reach()[1]) if box.heading_deg else box.size[1] / 2


def _share(part: float, total: float) -> float:
    return part / total if total > 0.0 else 0.0


def _growth(force: Floats, load: Floats) -> float:
    """Return the slope of a force over the load, by least squares; 0 without any load."""
    away = load - load.mean()
    spread = float(away @ away)
    return float(away @ (force - force.mean())) / spread if spread > 0.0 else 0.0


def _needed(run: Run, until: int) -> float:
    """Return the sum of the vertical force that moved the cargo as it moved, mass·g times samples.

    That is its weight, and its mass times its acceleration: a cargo in free fall needs none.
    """
    step = float(np.median(np.diff(run.time_s)))
    height = run.cargo_path[:until, 2]
    lift = np.diff(height, 2) / (step * step * gravity_of(run.trajectory))
    return float((run.cargo_mass[1 : until - 1] * (1.0 + lift)).sum())
