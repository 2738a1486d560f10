"""A model against another, task by task: in pairs where they share seeds."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from pydantic import BaseModel, ConfigDict

from buildarena_benchmark.leaderboard.cells import counted_trials
from buildarena_benchmark.leaderboard.ended_jobs import EndedJob
from buildarena_benchmark.statistics import (
    PairedTest,
    difference_interval,
    holm,
    paired_indicators,
    paired_successes,
)


class TaskComparison(BaseModel):
    """Two models on one task; tests only where they share seeds."""

    model_config = ConfigDict(frozen=True, use_attribute_docstrings=True)

    task: str
    successes: tuple[float, float]
    counted_jobs: tuple[int, int]
    difference: float
    """Success rate of the first minus that of the second."""
    ci_low: float
    """Lower end of its 95 % interval, unpaired."""
    ci_high: float
    success: PairedTest | None
    indicator: PairedTest | None
    success_p: float | None
    """Adjusted over the tests of both figures on all tasks (Holm)."""
    indicator_p: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """Two models on all tasks that both played."""

    first: str
    second: str
    tasks: Sequence[TaskComparison]


def compare_models(first: Sequence[EndedJob], second: Sequence[EndedJob]) -> Comparison | None:
    """Compare two models; None when one of them has no trial.

    Each side has one model configuration; p-values are adjusted by Holm over the tests of both
    figures on all tasks.
    """
    if not first or not second:
        return None
    sides = [_by_task(counted_trials(side)) for side in (first, second)]
    shared = [task for task in sides[0] if task in sides[1]]
    tasks = [_compare_task(task, sides[0][task], sides[1][task]) for task in sorted(shared)]
    tests = [test for t in tasks for test in (t.success, t.indicator) if test]
    p_values = iter(holm([test.p_value for test in tests]))
    return Comparison(
        first=first[0].model,
        second=second[0].model,
        tasks=[
            task.model_copy(
                update={
                    "success_p": next(p_values) if task.success else None,
                    "indicator_p": next(p_values) if task.indicator else None,
                }
            )
            for task in tasks
        ],
    )


def _by_task(trials: Iterable[EndedJob]) -> dict[str, list[EndedJob]]:
    by_task: dict[str, list[EndedJob]] = {}
    for trial in trials:
        by_task.setdefault(trial.task, []).append(trial)
    return by_task


def _compare_task(
    task: str, first: Sequence[EndedJob], second: Sequence[EndedJob]
) -> TaskComparison:
    seeds_1, seeds_2 = ({trial.seed: trial for trial in side} for side in (first, second))
    shared = sorted(seeds_1.keys() & seeds_2.keys())
    counts = tuple((math.fsum(t.success for t in side), len(side)) for side in (first, second))
    low, high = difference_interval(counts[0], counts[1])
    pairs = [(seeds_1[seed], seeds_2[seed]) for seed in shared]
    return TaskComparison(
        task=task,
        successes=(counts[0][0], counts[1][0]),
        counted_jobs=(counts[0][1], counts[1][1]),
        difference=counts[0][0] / counts[0][1] - counts[1][0] / counts[1][1],
        ci_low=low,
        ci_high=high,
        success=paired_successes([a.success for a, _ in pairs], [b.success for _, b in pairs]),
        indicator=paired_indicators(
            [a.indicator for a, _ in pairs], [b.indicator for _, b in pairs]
        ),
        success_p=None,
        indicator_p=None,
    )
