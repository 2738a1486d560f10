"""Landing: how near to a mark, and how soon, a machine released in the air comes down and stays."""

from typing import Annotated, Final, Literal

import numpy as np
from pydantic import Field

from buildarena_benchmark.fields import Document, Threshold
from buildarena_benchmark.scoring.flags import CAME_APART
from buildarena_benchmark.scoring.measures.carrying import rests
from buildarena_benchmark.scoring.measures.marks import MarkName, mark_of, unusable_mark
from buildarena_benchmark.scoring.measures.run import Run
from buildarena_benchmark.scoring.measures.series import tilt_deg
from buildarena_benchmark.scoring.measures.touchdown import first_touch, speeds_before
from buildarena_benchmark.scoring.scorer import Score, Scorer, Verdict, judged, undriven
from buildarena_simulation import Scenario
from buildarena_simulation.constants import SAMPLE_RATE_HZ
from buildarena_simulation.scenario import ReleasedPlacement

_RESTS: Final = 5
"""Samples over which it is judged whether a machine is at rest."""


class LandingScoring(Document):
    """Scoring of how gently a machine lands, and how near to a mark.

    Attributes:
        mark: Name of the mark in the scenario.
        max_sink: Largest sink rate at the first touch, units/s.
        max_slide: Largest speed sideways at the first touch, units/s.
        hold_s: Least time whole and upright after the first touch, seconds.
        max_tilt_deg: Largest tilt of the starting block relative to the start, degrees.
        max_speed: Largest speed at the end of that time, units/s.
        max_distance: Largest distance from the mark, as seen from above, units.
    """

    name: Literal["landing"]
    mark: MarkName = "goal"
    max_sink: Threshold = 2.0
    max_slide: Threshold = 1.0
    hold_s: Annotated[float, Field(ge=1, le=60)] = 3.0
    max_tilt_deg: Annotated[float, Field(gt=0, le=180)] = 20.0
    max_speed: Threshold = 0.1
    max_distance: Threshold = 3.0


def infeasible(scoring: LandingScoring, scenario: Scenario) -> str | None:
    """Return why no machine can pass; see `Scorer`."""
    if not isinstance(scenario.placement, ReleasedPlacement):
        return "a landing is judged, but scenario.placement.kind is not released"
    if scoring.hold_s >= scenario.duration_s:
        return f"hold_s {scoring.hold_s:g} is longer than the trial"
    return unusable_mark(scoring.mark, scenario) or undriven(scenario)


def judge(scoring: LandingScoring, run: Run) -> Verdict:
    """Measure 1 / (1 + d) at rest d from the mark, times the share of time left at touch.

    It lands where anything of it first touches ground or terrain: slowly enough downwards and
    sideways, by the speed of everything that is joined to the starting block. From then on it has
    some seconds to come to rest, in which it stays whole and upright; at their end the ground
    carries it. The starting block's distance from the mark, as seen from above, is measured then.

    Flags:
        `came_apart`: it would have passed, but lost parts. `forces_not_measured`: cannot be judged.
    """
    path = run.path
    touch = first_touch(run)
    end = len(path) if touch is None else touch + round(scoring.hold_s * SAMPLE_RATE_HZ)
    if touch is None or end >= len(path):
        return Verdict(success=False, indicator=0.0, metrics={"landed": touch is not None})
    sink, slide = speeds_before(run, touch)
    tilt = float(tilt_deg(run.trajectory, run.start)[touch : end + 1].max())
    last = path[end] - path[end - _RESTS]
    speed = float(np.linalg.norm(last)) * SAMPLE_RATE_HZ / _RESTS
    mark = mark_of(scoring.mark, run.scenario)
    away = float(np.linalg.norm(path[end, :2] - np.array(mark.center[:2])))
    landed = (
        sink < scoring.max_sink
        and slide < scoring.max_slide
        and tilt < scoring.max_tilt_deg
        and speed < scoring.max_speed
        and bool(rests(run)[end])
        and away < scoring.max_distance
    )
    intact = bool(run.joined[: end + 1].all())
    success = landed and intact
    left = 1.0 - float(run.time_s[touch]) / run.scenario.duration_s
    return judged(
        run,
        success=success,
        indicator=left / (1.0 + away) if success else 0.0,
        flags={CAME_APART: landed and not intact},
        metrics={
            "landed": True,
            "landing_s": run.time_s[touch],
            "sink_at_landing": sink,
            "slide_at_landing": slide,
            "max_tilt": tilt,
            "distance_to_mark": away,
        },
        samples=end + 1,
    )


def explain(scoring: LandingScoring, scenario: Scenario, score: Score) -> str:
    """Return what happened; see `Scorer`."""
    metrics = score.metrics
    if "distance_to_mark" not in metrics:
        if metrics.get("landed"):
            return f"It landed less than {scoring.hold_s:g} s before the end of the trial."
        return f"It did not land within {scenario.duration_s:g} s."
    figures = (
        ("came down at {:.2f} units/s", "sink_at_landing", scoring.max_sink),
        ("slid at {:.2f} units/s", "slide_at_landing", scoring.max_slide),
        ("leaned by {:.0f}°", "max_tilt", scoring.max_tilt_deg),
        ("landed {:.1f} from the mark", "distance_to_mark", scoring.max_distance),
    )
    for template, name, limit in figures:
        if metrics[name] > limit:
            return f"It {template.format(metrics[name])}; at most {limit:g} is allowed."
    landed = f"It landed {metrics['distance_to_mark']:.2f} from the mark"
    if score.success:
        return f"{landed}."
    return f"{landed}, but did not rest on the ground as a whole {scoring.hold_s:g} s later."


SCORER: Final = Scorer(
    parameters=LandingScoring,
    judge=judge,
    explain=explain,
    infeasible=infeasible,
    flags=(CAME_APART,),
    ceiling=lambda _scoring, _scenario: 1.0,
)
