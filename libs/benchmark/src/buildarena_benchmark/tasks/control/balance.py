"""Balance: nearness to the start of a machine on two wheels, its mass above their axle."""

from typing import Annotated, Final, Literal

import numpy as np
from pydantic import Field

from buildarena_benchmark.fields import Document, Threshold
from buildarena_benchmark.scoring.flags import CAME_APART, Flag
from buildarena_benchmark.scoring.measures.outline import lowest_points
from buildarena_benchmark.scoring.measures.run import Run
from buildarena_benchmark.scoring.measures.series import lasts
from buildarena_benchmark.scoring.scorer import Score, Scorer, Verdict, judged, undriven
from buildarena_benchmark.tasks.control.balancing import (
    axle_turn_deg,
    height_over_wheels,
    lean_deg,
    two_wheels,
)
from buildarena_simulation import Scenario
from buildarena_simulation.scenario import GroundPlacement

NOT_ON_TWO_WHEELS: Final = Flag(
    name="not_on_two_wheels",
    meaning="The machine did not begin on exactly two wheels of one axle that lies east and west.",
)
PROPPED: Final = Flag(
    name="propped",
    meaning="The machine stood upright for long enough, but something other than its wheels came "
    "near the ground, its mass was too low, or it turned away.",
)


class BalanceScoring(Document):
    """Scoring of how near to its start a machine balances on two wheels.

    Attributes:
        min_s: Least duration of balancing, seconds.
        max_tilt_deg: Largest tilt of the starting block relative to the built machine, degrees.
        min_height: Height of its centre of mass above the middle between the wheels, units.
        min_clearance: Least height above the ground of everything but the wheels, units.
        max_turn_deg: Largest angle of the axle to the line from west to east, degrees.
    """

    name: Literal["balance"]
    min_s: Annotated[float, Field(gt=0, le=600)] = 20.0
    max_tilt_deg: Annotated[float, Field(gt=0, lt=90)] = 25.0
    min_height: Threshold = 1.5
    min_clearance: Threshold = 0.2
    max_turn_deg: Annotated[float, Field(gt=0, lt=90)] = 30.0


def infeasible(scoring: BalanceScoring, scenario: Scenario) -> str | None:
    """Return why no machine can pass; see `Scorer`."""
    if not isinstance(scenario.placement, GroundPlacement) or scenario.terrain or scenario.cargo:
        return "a balance is judged, but the machine is not alone on flat ground"
    if scoring.min_s > scenario.duration_s:
        return f"min_s {scoring.min_s:g} is longer than the trial"
    return undriven(scenario)


def judge(scoring: BalanceScoring, run: Run) -> Verdict:
    """Measure the mean of 1 / (1 + d) over the trial, d from its start, while it balances.

    The distance is that of the starting block, as seen from above. Moments after it stopped
    balancing count as 0.

    It balances until, for the first time, something came off, the starting block leans too far,
    the centre of the mass is too low above the wheels, something but the wheels is too near the
    ground, or the axle is turned too far. A mass above the axle falls without control, whatever is
    braked; one that turns about the vertical might not.

    Flags:
        `not_on_two_wheels`: the wheels are not as they must be. `came_apart`: it would have
        passed, but lost parts. `propped`: it would have passed without the rules on support.
        `forces_not_measured`: cannot be judged.
    """
    wheels = two_wheels(run)
    if wheels is None:
        return Verdict(success=False, indicator=0.0, flags=(NOT_ON_TWO_WHEELS,))
    start = run.start
    intact, non_wheels = run.joined.all(axis=1), np.ones_like(run.joined)
    non_wheels[:, wheels] = False
    upright = lean_deg(run, start) < scoring.max_tilt_deg
    above = height_over_wheels(run, wheels) >= scoring.min_height
    clear = lowest_points(run, non_wheels) >= scoring.min_clearance
    ahead = axle_turn_deg(run, wheels) < scoring.max_turn_deg
    time_s, path = run.time_s, run.positions[:, start, :2]
    away = np.linalg.norm(path - path[0], axis=1)
    end = lasts(intact & upright & above & clear & ahead)
    balanced_s = float(time_s[end])
    nearness = float((1.0 / (1.0 + away))[: end + 1].sum()) / len(away) if end else 0.0
    success = balanced_s >= scoring.min_s
    stood_s = {
        flag: float(time_s[lasts(upright & holds)])
        for flag, holds in ((CAME_APART, above & clear & ahead), (PROPPED, intact))
    }
    return judged(
        run,
        success=success,
        indicator=nearness,
        flags={flag: lasted >= scoring.min_s and not success for flag, lasted in stood_s.items()},
        metrics={
            "balanced_s": balanced_s,
            "farthest_from_start": away[: end + 1].max(),
        },
        samples=end + 1,
    )


def explain(scoring: BalanceScoring, scenario: Scenario, score: Score) -> str:
    """Return what happened; see `Scorer`."""
    held = score.metrics.get("balanced_s", 0.0)
    if score.success:
        return f"It balanced for {held:.1f} s."
    return f"It balanced by all rules for {held:.1f} s; {scoring.min_s:g} s is asked."


SCORER: Final = Scorer(
    parameters=BalanceScoring,
    judge=judge,
    explain=explain,
    infeasible=infeasible,
    flags=(NOT_ON_TWO_WHEELS, CAME_APART, PROPPED),
    ceiling=lambda _scoring, _scenario: 1.0,
)
