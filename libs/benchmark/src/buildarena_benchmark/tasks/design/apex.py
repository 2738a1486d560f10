"""Apex: how near to a stated height a cargo's highest point is."""

from typing import Annotated, Final, Literal

import numpy as np
from pydantic import Field

from buildarena_benchmark.fields import Document, Threshold
from buildarena_benchmark.scoring.flags import CAME_APART, NOT_AIRBORNE
from buildarena_benchmark.scoring.measures.carrying import is_airborne
from buildarena_benchmark.scoring.measures.run import Run
from buildarena_benchmark.scoring.scorer import Score, Scorer, Verdict, judged, undriven
from buildarena_simulation import Scenario


class ApexScoring(Document):
    """Scoring of how near to a stated rise a cargo comes, at its highest point.

    Attributes:
        rise: Required height of the cargo's highest point above its place, units.
        reach: Deviation from the rise at which the indicator is 0, units.
        max_off: Largest deviation of a trial that passes, units.
    """

    name: Literal["apex"]
    rise: Annotated[float, Field(gt=0, le=1e4)]
    reach: Annotated[float, Field(gt=0, le=1e4)] = 10.0
    max_off: Threshold = 2.0


def infeasible(scoring: ApexScoring, scenario: Scenario) -> str | None:
    """Return why no machine can pass; see `Scorer`."""
    if scenario.cargo is None or scenario.cargo.at is None:
        return "the cargo rises from its place, but scenario.cargo has none: give cargo.at"
    if scoring.max_off >= scoring.reach:
        return f"max_off {scoring.max_off:g} must be less than reach {scoring.reach:g}"
    return undriven(scenario)


def judge(scoring: ApexScoring, run: Run) -> Verdict:
    """Measure 1 where the cargo's highest point has the stated rise, linearly less around.

    It counts if the machine is whole until then, and flies at that moment: over the last half
    second nothing of it touches ground or terrain. So it is flown up, not put up by a tower, a
    lever or a crane. A machine that falls down afterwards may break.

    Flags:
        `not_airborne`: it would have passed, but the machine touches the ground. `came_apart`: it
        would have passed, but parts came off. `forces_not_measured`: cannot be judged.
    """
    height = run.cargo_path[:, 2]
    top = int(np.nanargmax(height)) if np.isfinite(height).any() else 0
    rise = float(height[top] - height[0])
    intact = bool(run.joined[: top + 1].all())
    flies = bool(is_airborne(run)[top])
    off = abs(rise - scoring.rise)
    close = off <= scoring.max_off
    counts = intact and flies
    worth = max(1.0 - off / scoring.reach, 0.0) if counts else 0.0
    flags = {NOT_AIRBORNE: close and not flies, CAME_APART: close and not intact}
    return judged(
        run,
        success=close and counts,
        indicator=worth,
        flags=flags,
        metrics={
            "rise": rise,
            "top_s": run.time_s[top],
        },
        samples=top + 1,
        cargo=True,
    )


def explain(scoring: ApexScoring, scenario: Scenario, score: Score) -> str:
    """Return what happened; see `Scorer`."""
    rise = score.metrics.get("rise")
    if rise is None:
        return "The cargo was not carried up."
    off = abs(rise - scoring.rise)
    return (
        f"The cargo rose by {rise:.2f}: {off:.2f} off {scoring.rise:g}, and {scoring.max_off:g} "
        "is allowed."
    )


SCORER: Final = Scorer(
    parameters=ApexScoring,
    judge=judge,
    explain=explain,
    infeasible=infeasible,
    needs="cargo",
    flags=(NOT_AIRBORNE, CAME_APART),
    ceiling=lambda _scoring, _scenario: 1.0,
)
