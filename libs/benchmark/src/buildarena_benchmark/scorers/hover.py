"""Hover: how long a machine holds its height in the air with its cargo."""

from typing import Annotated, Final, Literal

import numpy as np
from pydantic import Field

from buildarena_benchmark.fields import Threshold
from buildarena_benchmark.scorers.measures.components import Mask
from buildarena_benchmark.scorers.measures.flight import (
    NOT_AIRBORNE,
    NOT_RISEN,
    FlightScoring,
    flight_of,
    runs_of,
)
from buildarena_benchmark.scorers.measures.unmeasured import unmeasured
from buildarena_benchmark.scorers.scorer import (
    FORCES_NOT_MEASURED,
    NOT_CARRIED,
    Deciding,
    Metric,
    Scorer,
    Verdict,
    raised,
    rounded,
)
from buildarena_geometry import Machine
from buildarena_simulation import Scenario, Trajectory
from buildarena_simulation.constants import SAMPLE_RATE_HZ


class HoverScoring(FlightScoring):
    """How long a machine holds a height with its cargo in steady flight.

    Attributes:
        height: Of the starting block's centre, units.
        band: How far it may be above or below, units.
        hold_s: For how long in a row, seconds.
    """

    name: Literal["hover"]
    height: Threshold = 10.0
    band: Threshold = 1.5
    hold_s: Annotated[float, Field(gt=0, le=600)] = 8.0


def infeasible(scoring: HoverScoring, scenario: Scenario) -> str | None:
    """Why no machine can pass; see `Scorer`."""
    if scenario.cargo is None:
        return "the cargo is carried, but scenario has no cargo"
    if scoring.hold_s > scenario.duration_s:
        return f"hold_s {scoring.hold_s:g} is longer than the trial"
    for name in ("min_clearance", "min_rise"):
        least = getattr(scoring, name)
        if least >= scoring.height + scoring.band:
            return f"{name} {least:g} is above the band, which ends at height + band"
    return None


def judge(
    scoring: HoverScoring, scenario: Scenario, machine: "Machine", trajectory: "Trajectory"
) -> Verdict:
    """The indicator is the longest time in a row within the band, seconds.

    At each moment the starting block must be within the band, nearly upright and near where it
    started, the machine must bear its cargo, nothing of it may touch the ground, and the whole of
    it must have risen: its lowest point above the ground, the starting block above its start.

    Args:
        scoring: Thresholds.
        scenario: What the machine was put through.
        machine: The machine.
        trajectory: The trial.

    Flags:
        `not_airborne`: it would have passed, but touches the ground. `not_carried`: it would have
        passed, but without the cargo. `not_risen`: it would have passed, but for a part near the
        ground, or because it started high up. `forces_not_measured`: cannot be judged.
    """
    lacking = unmeasured(trajectory, cargo=True)
    if lacking is not None:
        return lacking
    flight = flight_of(scoring, machine, trajectory)
    height = flight.path[:, 2]
    within = np.abs(height - scoring.height) <= scoring.band

    def longest_s(holds: Mask) -> float:
        runs = runs_of(within & holds)
        return max((after - first - 1 for first, after in runs), default=0) / SAMPLE_RATE_HZ

    def passes(holds: Mask) -> bool:
        return longest_s(holds) >= scoring.hold_s

    steady = within & flight.steady
    metrics: dict[str, Metric] = {
        "max_height": rounded(height.max()),
        "max_tilt": rounded(flight.tilt.max(initial=0.0, where=steady)),
        "drift": rounded(flight.drift.max(initial=0.0, where=steady)),
        "min_clearance": rounded(flight.clearance.min(initial=np.inf, where=steady))
        if steady.any()
        else None,
        "broken_joints": len(trajectory.breaks),
    }
    return Verdict(
        success=passes(flight.holds()),
        indicator=rounded(longest_s(flight.holds())),
        metrics=metrics,
        flags=raised(flight.flags(passes)),
        deciding=Deciding(samples=len(height), members=flight.joined, cargo=True),
    )


SCORER: Final = Scorer(
    parameters=HoverScoring,
    judge=judge,
    infeasible=infeasible,
    flags=(NOT_AIRBORNE, NOT_CARRIED, NOT_RISEN, FORCES_NOT_MEASURED),
    ceiling=lambda _scoring, scenario: scenario.duration_s,
)
