"""Heights: how long a machine holds one height after the other in the air, with its cargo."""

from collections.abc import Sequence
from typing import Annotated, Final, Literal

import numpy as np
from pydantic import Field

from buildarena_benchmark.fields import Threshold
from buildarena_benchmark.scoring.measures.components import Mask
from buildarena_benchmark.scoring.measures.flight import (
    NOT_AIRBORNE,
    NOT_RISEN,
    FlightScoring,
    flight_of,
    runs_of,
)
from buildarena_benchmark.scoring.measures.unmeasured import unmeasured
from buildarena_benchmark.scoring.scorer import (
    FORCES_NOT_MEASURED,
    NOT_CARRIED,
    Deciding,
    Finding,
    Metric,
    Scorer,
    Verdict,
    raised,
    rounded,
)
from buildarena_geometry import Machine
from buildarena_simulation import Scenario, Trajectory
from buildarena_simulation.constants import SAMPLE_RATE_HZ

Run = tuple[int, int]
"""First sample, and the one after the last."""


class HeightsScoring(FlightScoring):
    """Scoring of how long a machine holds several heights in steady flight with its cargo.

    Attributes:
        heights: Heights of the starting block's centre, in the order in which they are held, units.
        band: Largest distance above or below, units.
        hold_s: Least time in a row at each height for a success, seconds.
        most_s: Most time at a height that counts, seconds.
    """

    name: Literal["heights"]
    heights: Annotated[tuple[Threshold, ...], Field(min_length=1, max_length=10)]
    band: Threshold = 0.5
    hold_s: Annotated[float, Field(gt=0, le=600)] = 3.0
    most_s: Annotated[float, Field(gt=0, le=600)] = 10.0


def infeasible(scoring: HeightsScoring, scenario: Scenario) -> str | None:
    """Return why no machine can pass; see `Scorer`."""
    if scenario.cargo is None:
        return "the cargo is carried, but scenario has no cargo"
    if scoring.hold_s > scoring.most_s:
        return f"hold_s {scoring.hold_s:g} is longer than most_s {scoring.most_s:g}"
    if scoring.hold_s * len(scoring.heights) > scenario.duration_s:
        return f"hold_s {scoring.hold_s:g} at every height is longer than the trial"
    for name in ("min_clearance", "min_rise"):
        threshold = getattr(scoring, name)
        if threshold >= min(scoring.heights) + scoring.band:
            return f"{name} {threshold:g} is above the lowest band"
    return None


def judge(
    scoring: HeightsScoring, scenario: Scenario, machine: "Machine", trajectory: "Trajectory"
) -> Verdict:
    """Measure the time for which the heights were held, one after the other, seconds.

    Each height counts with one stretch of time within its band, up to a longest, after that of the
    height before; of all such choices the best. In it the machine is nearly upright and near where
    it started, carries its cargo, touches nothing, and has risen as a whole.

    Flags:
        `not_airborne`: it would have passed, but touches the ground. `not_carried`: it would have
        passed, but without the cargo. `not_risen`: it would have passed, but a part is near the
        ground. `forces_not_measured`: cannot be judged.
    """
    del scenario
    lacking = unmeasured(trajectory, cargo=True)
    if lacking is not None:
        return lacking
    flight = flight_of(scoring, machine, trajectory)
    path = flight.path[:, 2]
    bands = [np.abs(path - height) <= scoring.band for height in scoring.heights]

    def held(holds: Mask) -> list[float]:
        return _held_s([runs_of(band & holds) for band in bands], most_s=scoring.most_s)

    def passes(holds: Mask) -> bool:
        return min(held(holds)) >= scoring.hold_s

    times = held(flight.holds())
    metrics: dict[str, Metric] = {
        "max_height": rounded(path.max()),
        "heights_held": sum(time >= scoring.hold_s for time in times),
        "least_time_held": rounded(min(times)),
        "broken_joints": len(trajectory.breaks),
    }
    return Verdict(
        success=passes(flight.holds()),
        indicator=rounded(sum(times)),
        metrics=metrics,
        flags=raised(flight.flags(passes)),
        deciding=Deciding(samples=len(path), members=flight.joined, cargo=True),
    )


def _held_s(runs: "Sequence[Sequence[Run]]", *, most_s: float) -> list[float]:
    """Return how long each height is held in the best choice of a stretch each, in order, seconds.

    Args:
        runs: Stretches in order of time, by height.
        most_s: Most time of a stretch that counts.
    """
    best: dict[int, list[float]] = {0: []}  # by when the last stretch of the choice ends
    for stretches in runs:
        grown = {end: [*times, 0.0] for end, times in best.items()}
        for first, after in stretches:
            lasts = min((after - first - 1) / SAMPLE_RATE_HZ, most_s)
            before = [times for end, times in best.items() if end <= first]
            times = [*max(before, key=sum), lasts]
            if sum(times) > sum(grown.get(after, [])) or after not in grown:
                grown[after] = times
        best = grown
    return max(best.values(), key=sum)


def explain(scoring: HeightsScoring, scenario: Scenario, score: Finding) -> str:
    """Return what happened; see `Scorer`."""
    held = score.metrics.get("heights_held", 0)
    if score.success:
        shortest_s = score.metrics["least_time_held"]
        return f"All {held} heights were held, the shortest for {shortest_s:.1f} s."
    return (
        f"The machine held {held} of {len(scoring.heights)} heights for {scoring.hold_s:g} s, and "
        f"got {score.metrics.get('max_height', 0.0):.1f} high."
    )


SCORER: Final = Scorer(
    parameters=HeightsScoring,
    judge=judge,
    explain=explain,
    infeasible=infeasible,
    flags=(NOT_AIRBORNE, NOT_CARRIED, NOT_RISEN, FORCES_NOT_MEASURED),
    ceiling=lambda scoring, _scenario: len(scoring.heights) * scoring.most_s,
)
