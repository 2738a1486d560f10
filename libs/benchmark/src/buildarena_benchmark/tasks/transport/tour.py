"""Tour: how near to several marks, one after the other, a vehicle stops, and how soon."""

from collections.abc import Callable
from functools import partial
from typing import Annotated, Final, Literal

import numpy as np
from pydantic import Field

from buildarena_benchmark.fields import Document, Threshold
from buildarena_benchmark.scoring.flags import NOT_DRIVEN
from buildarena_benchmark.scoring.measures.components import Mask
from buildarena_benchmark.scoring.measures.marks import moving_mark
from buildarena_benchmark.scoring.measures.rolling import is_driven
from buildarena_benchmark.scoring.measures.run import Run
from buildarena_benchmark.scoring.measures.series import Series
from buildarena_benchmark.scoring.scorer import Score, Scorer, Verdict, judged, undriven
from buildarena_simulation import Scenario
from buildarena_simulation.constants import SAMPLE_RATE_HZ


class TourScoring(Document):
    """Scoring of how near to the scenario's marks, in their order, a vehicle stops.

    Attributes:
        reach: Largest distance of a stop to its mark, units.
        max_distance: Largest distance of a stop to its mark in a trial that passes, units.
        stop_s: Least duration of a stop, seconds.
        max_speed: Speed below which it is a stop, units/s.
    """

    name: Literal["tour"]
    reach: Annotated[float, Field(gt=0, le=1000)] = 2.0
    max_distance: Threshold = 1.0
    stop_s: Annotated[float, Field(gt=0, le=600)] = 0.4
    max_speed: Threshold = 0.25


def infeasible(scoring: TourScoring, scenario: Scenario) -> str | None:
    """Return why no machine can pass; see `Scorer`."""
    if not scenario.marks:
        return "a vehicle goes from mark to mark, but scenario.marks has none"
    if scoring.stop_s * len(scenario.marks) >= scenario.duration_s:
        return f"stops of {scoring.stop_s:g} s at every mark are longer than the trial"
    return moving_mark(scenario) or undriven(scenario)


def judge(scoring: TourScoring, run: Run) -> Verdict:
    """Measure how near to its marks the vehicle stopped, and the share of time left.

    The starting block is to stop at each mark in order. Each first stop within reach is worth 1 at
    the mark itself and linearly less down to 0 at the reach; marks after one that was missed are
    worth nothing. Once it has stopped at the last, the share of the time that is left then is
    added. It counts where wheels drove it from the stop before, as `explained_distances` returns.

    Flags:
        `not_driven`: it would have passed, but not by wheels. `forces_not_measured`: cannot be
        judged.
    """
    path = run.path

    stops = _stops(scoring, run.scenario, path, partial(is_driven, run, path))
    anyhow = _stops(scoring, run.scenario, path, lambda _: np.ones(len(path), dtype=bool))
    distances = _distances(run.scenario, path, stops)
    passes = _passes(scoring, run.scenario, distances)
    complete = len(stops) == len(run.scenario.marks)
    last_s = float(run.time_s[stops[-1]]) if stops else None
    left = 1.0 - last_s / run.scenario.duration_s if complete and last_s is not None else 0.0
    would = _passes(scoring, run.scenario, _distances(run.scenario, path, anyhow))
    return judged(
        run,
        success=passes,
        indicator=sum(1.0 - each / scoring.reach for each in distances) + left,
        flags={NOT_DRIVEN: would and not passes},
        metrics={
            "stops": len(stops),
            "last_stop_s": last_s,
            "mean_distance_to_mark": float(np.mean(distances)) if distances else None,
            "largest_distance_to_mark": max(distances) if distances else None,
        },
        samples=len(path),
    )


def _stops(
    scoring: TourScoring, scenario: Scenario, path: Series, counts: "Callable[[int], Mask]"
) -> list[int]:
    """Return the sample at which each mark's first stop is long enough, until one is missed.

    Args:
        path: (T, 3) units.
        counts: Called with a sample: (T,) bool, whether the vehicle counts as driven since it.
    """
    count = round(scoring.stop_s * SAMPLE_RATE_HZ)
    steps = np.linalg.norm(np.diff(path[:, :2], axis=0), axis=1) * SAMPLE_RATE_HZ
    slow = np.concatenate([[0], np.cumsum(steps < scoring.max_speed)])
    stopped = np.zeros(len(path), dtype=bool)
    stopped[count:] = slow[count:] - slow[:-count] == count
    samples: list[int] = []
    since = 0
    for mark in scenario.marks:
        close = np.linalg.norm(path[:, :2] - np.array(mark.center[:2]), axis=1) <= scoring.reach
        stops = np.flatnonzero(close & stopped & counts(since))
        stops = stops[stops > since]
        if not len(stops):
            break
        since = int(stops[0])
        samples.append(since)
    return samples


def _distances(scenario: Scenario, path: Series, stops: list[int]) -> list[float]:
    """Return how far from its mark each stop is, horizontally, units."""
    return [
        float(np.linalg.norm(path[stop, :2] - np.array(mark.center[:2])))
        for mark, stop in zip(scenario.marks, stops, strict=False)
    ]


def _passes(scoring: TourScoring, scenario: Scenario, distances: list[float]) -> bool:
    """Return whether it stopped at all marks, and near enough to each."""
    return len(distances) == len(scenario.marks) and max(distances) <= scoring.max_distance


def explain(scoring: TourScoring, scenario: Scenario, score: Score) -> str:
    """Return what happened; see `Scorer`."""
    metrics, count = score.metrics, len(scenario.marks)
    stops = metrics.get("stops", 0)
    worst = metrics.get("largest_distance_to_mark") or 0.0
    if stops < count:
        return f"It stopped at {stops} of {count} marks in order, within {scoring.reach:g} of each."
    stopped = f"It made all {count} stops, the farthest {worst:.2f} away"
    return f"{stopped}." if score.success else f"{stopped}; {scoring.max_distance:g} is allowed."


SCORER: Final = Scorer(
    parameters=TourScoring,
    judge=judge,
    explain=explain,
    infeasible=infeasible,
    flags=(NOT_DRIVEN,),
    ceiling=lambda _scoring, scenario: len(scenario.marks) + 1.0,
)
