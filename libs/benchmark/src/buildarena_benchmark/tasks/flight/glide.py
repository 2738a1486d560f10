"""Glide: how far a machine that is released in the air flies, and how gently it lands."""

from typing import Final, Literal

import numpy as np

from buildarena_benchmark.fields import Document, Threshold
from buildarena_benchmark.scoring.measures.run import Run
from buildarena_benchmark.scoring.measures.touchdown import first_touch, speeds_before
from buildarena_benchmark.scoring.scorer import Score, Scorer, Verdict, judged
from buildarena_simulation import Scenario
from buildarena_simulation.scenario import ReleasedPlacement


class GlideScoring(Document):
    """Scoring of how far a machine that is released in the air flies, and how gently it lands.

    Attributes:
        min_range: Least horizontal distance to the landing, units.
        max_sink: Largest sink rate at landing, units/s.
    """

    name: Literal["glide"]
    min_range: Threshold = 80.0
    max_sink: Threshold = 6.0


def infeasible(scoring: GlideScoring, scenario: Scenario) -> str | None:
    """Return why no machine can pass; see `Scorer`."""
    if not isinstance(scenario.placement, ReleasedPlacement):
        return "a glider is judged, but scenario.placement.kind is not released"
    return None


def judge(scoring: GlideScoring, run: Run) -> Verdict:
    """Measure the horizontal distance flown over the height of release, 0 of a failure.

    The flight ends when anything of the machine touches ground or terrain. The distance is the
    starting block's; the speed at landing is that of everything that is still joined to it.

    Flags:
        `forces_not_measured`: cannot be judged.
    """
    placement = run.scenario.placement
    assert isinstance(placement, ReleasedPlacement)  # noqa: S101 - the task was checked for it
    path = run.path
    touch = first_touch(run)
    landed = touch is not None
    last = len(path) - 1 if touch is None else touch
    flown = float(np.linalg.norm(path[last, :2] - path[0, :2]))
    sink, _ = speeds_before(run, last)
    success = landed and flown > scoring.min_range and sink < scoring.max_sink
    return judged(
        run,
        success=success,
        indicator=flown / placement.height if success else 0.0,
        metrics={
            "range": flown,
            "landed": landed,
            "landing_s": run.time_s[last] if landed else None,
            "sink_at_landing": sink,
        },
        samples=last + 1,
    )


def explain(scoring: GlideScoring, scenario: Scenario, score: Score) -> str:
    """Return what happened; see `Scorer`."""
    metrics = score.metrics
    if not metrics.get("landed"):
        return f"The glider did not come down within {scenario.duration_s:g} s."
    sink = metrics["sink_at_landing"]
    flew = f"The glider flew {metrics['range']:.1f} and came down at {sink:.1f}"
    if score.success:
        return f"{flew} units/s."
    asked = f"at least {scoring.min_range:g} at less than {scoring.max_sink:g} units/s is asked"
    return f"{flew} units/s; {asked}."


SCORER: Final = Scorer(
    parameters=GlideScoring,
    judge=judge,
    explain=explain,
    infeasible=infeasible,
)
