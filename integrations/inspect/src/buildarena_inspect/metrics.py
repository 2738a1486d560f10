"""Metrics of one log, made by the benchmark's own statistics."""

from __future__ import annotations

from typing import Final

import numpy as np
from inspect_ai.scorer import Metric, SampleScore, Value, metric, value_to_float

from buildarena_benchmark.environment import references
from buildarena_benchmark.statistics import mean_interval, mean_ranks, wilson_interval

DIGITS: Final = 4
"""References have so many; more would make equal figures differ."""


def named(indicator: str, unit: str) -> str:
    """An indicator with its unit in brackets; a ratio has none."""
    return indicator if unit == "1" else f"{indicator} ({unit})"


@metric(scores="unreduced")
def success_interval() -> Metric:
    """The 95 % Wilson interval of the success rate; each epoch is a trial."""
    to_float = value_to_float()

    def compute(scores: list[SampleScore]) -> Value:
        if not scores:
            return {}
        low, high = wilson_interval(
            sum(to_float(found.score.value) == 1.0 for found in scores), len(scores)
        )
        return {"wilson_low": low, "wilson_high": high}

    return compute


@metric(scores="unreduced")
def indicator_by_task() -> Metric:
    """The mean indicator of each task, named with its unit, and its 95 % interval if it has one.

    Tasks have different units, so there is no mean over tasks.
    """

    def compute(scores: list[SampleScore]) -> Value:
        told: dict[str, float] = {}
        for task, found in _by_task(scores).items():
            about = found[0].score.metadata or {}
            values = np.array([one.score.as_float() for one in found])
            won = np.array([bool((one.score.metadata or {})["success"]) for one in found])
            name = f"{task} {named(about['indicator'], about['unit'])}"
            told[name] = float(values.mean())
            interval = mean_interval(values, won)
            if interval is not None:
                told[f"{name} low"], told[f"{name} high"] = interval
        return dict(told)

    return compute


@metric(scores="unreduced")
def mean_rank() -> Metric:
    """Mean rank over tasks and both figures, beside the built-in expert: 1 is better in all.

    1.5 is as good, 2 is behind in everything. It is the leaderboards' rank aggregation; models of
    several logs are ranked by a service that they are brought into.
    """

    def compute(scores: list[SampleScore]) -> Value:
        known = references()
        tasks = [task for task in _by_task(scores) if task in known]
        if not tasks:
            return {}
        found = _by_task(scores)
        rates = [[_rate(found[task]), 1.0] for task in tasks]
        figures = [[round(_mean(found[task]), DIGITS), known[task]] for task in tasks]
        return {"mean_rank": float(mean_ranks(np.array(rates), np.array(figures))[0])}

    return compute


def _by_task(scores: list[SampleScore]) -> dict[str, list[SampleScore]]:
    tasks: dict[str, list[SampleScore]] = {}
    for found in scores:
        tasks.setdefault(str((found.score.metadata or {})["task"]), []).append(found)
    return tasks


def _rate(scores: list[SampleScore]) -> float:
    return float(np.mean([bool((found.score.metadata or {})["success"]) for found in scores]))


def _mean(scores: list[SampleScore]) -> float:
    return float(np.mean([found.score.as_float() for found in scores]))
