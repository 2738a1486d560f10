"""Station: how much of a time a machine in the air keeps to a mark."""

from typing import Annotated, Final, Literal

import numpy as np
from pydantic import Field

from buildarena_benchmark.fields import Document
from buildarena_benchmark.scoring.flags import NOT_AIRBORNE
from buildarena_benchmark.scoring.measures.carrying import is_airborne
from buildarena_benchmark.scoring.measures.marks import MarkName, mark_of, unknown_mark
from buildarena_benchmark.scoring.measures.masses import center_of
from buildarena_benchmark.scoring.measures.run import Run
from buildarena_benchmark.scoring.scorer import Score, Scorer, Verdict, judged, undriven
from buildarena_simulation import Scenario


class StationScoring(Document):
    """Scoring of how long a machine is near a mark in the air.

    Attributes:
        mark: Name of the mark in the scenario.
        radius: Largest distance that counts as near, units.
        from_s: Start of the time that counts, until the end of the trial, seconds.
        min_share: Least share of that time, of a trial that passes.
    """

    name: Literal["station"]
    mark: MarkName = "goal"
    radius: Annotated[float, Field(gt=0, le=100)] = 1.5
    from_s: Annotated[float, Field(ge=0, le=600)] = 5.0
    min_share: Annotated[float, Field(gt=0, le=1)] = 0.7


def infeasible(scoring: StationScoring, scenario: Scenario) -> str | None:
    """Return why no machine can pass; see `Scorer`."""
    if scoring.from_s >= scenario.duration_s:
        return f"from_s {scoring.from_s:g} is not within the trial"
    return unknown_mark(scoring.mark, scenario) or undriven(scenario)


def judge(scoring: StationScoring, run: Run) -> Verdict:
    """Measure the mean nearness: 1 at the mark, 0 at the radius and beyond.

    Where the mark moves, it is where the mark is then. It is measured from the centre of the
    mass of all that is joined to the starting block, and a moment counts only while none of
    that touches ground or terrain.

    Flags:
        `not_airborne`: it was near long enough, but touched something. `forces_not_measured`:
        cannot be judged.
    """
    mark = mark_of(scoring.mark, run.scenario)
    away = center_of(run) - np.array([mark.at(time_s) for time_s in run.time_s.tolist()])
    distance = np.linalg.norm(away, axis=1)
    is_near = distance < scoring.radius
    flies = is_airborne(run)
    counts = run.time_s >= scoring.from_s
    share = float((is_near & flies)[counts].mean())
    nearness = np.clip(1.0 - distance / scoring.radius, 0.0, None) * flies
    success = share >= scoring.min_share
    anyhow = float(is_near[counts].mean()) >= scoring.min_share
    return judged(
        run,
        success=success,
        indicator=nearness[counts].mean(),
        flags={NOT_AIRBORNE: anyhow and not success},
        metrics={
            "share_near": share,
            "mean_distance": distance[counts].mean(),
        },
        samples=len(distance),
    )


def explain(scoring: StationScoring, scenario: Scenario, score: Score) -> str:
    """Return what happened; see `Scorer`."""
    share = score.metrics.get("share_near", 0.0)
    stay = f"It was within {scoring.radius:g} of the place for {share:.0%} of the time"
    return f"{stay}." if score.success else f"{stay}; {scoring.min_share:.0%} is asked."


SCORER: Final = Scorer(
    parameters=StationScoring,
    judge=judge,
    explain=explain,
    infeasible=infeasible,
    flags=(NOT_AIRBORNE,),
    ceiling=lambda _scoring, _scenario: 1.0,
)
