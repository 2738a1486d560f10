"""Metrics of a log, computed by the benchmark's statistics."""

from __future__ import annotations

from typing import Final

import numpy as np
from inspect_ai.scorer import Metric, SampleScore, Value, metric, value_to_float

from buildarena_benchmark.environment import references
from buildarena_benchmark.statistics import mean_interval, mean_ranks, wilson_interval

DIGITS: Final = 4
"""Digits of references; more would make equal figures differ."""


def with_unit(indicator: str, unit: str) -> str:
    """Return an indicator's name with its unit in brackets; a ratio has none."""
    return indicator if unit == "1" else f"{indicator} ({unit})"


@metric(scores="unreduced")
def success_interval() -> Metric:
    """Compute the 95 % Wilson interval of the success rate; each epoch is a trial."""
    to_float = value_to_float()

    def compute(scores: list[SampleScore]) -> Value:
        if not scores:
            return {}
        successes = sum(to_float(sample.score.value) == 1.0 for sample in scores)
        low, high = wilson_interval(successes, len(scores))
        return {"wilson_low": low, "wilson_high": high}

    return compute


@metric(scores="unreduced")
def indicator_by_task() -> Metric:
    """Compute the mean indicator of each task, named with its unit, and its 95 % interval if any.

    Tasks have different units, so there is no mean over tasks.
    """

    def compute(scores: list[SampleScore]) -> Value:
        figures: dict[str, float] = {}
        for task, samples in _by_task(scores).items():
            about = samples[0].score.metadata or {}
            values = np.array([sample.score.as_float() for sample in samples])
            won = np.array([bool((s.score.metadata or {})["success"]) for s in samples])
            name = f"{task} {with_unit(about['indicator'], about['unit'])}"
            figures[name] = float(values.mean())
            interval = mean_interval(values, won)
            if interval is not None:
                figures[f"{name} low"], figures[f"{name} high"] = interval
        return dict(figures)

    return compute


@metric(scores="unreduced")
def mean_rank() -> Metric:
    """Compute the mean rank against the built-in expert over tasks and both figures.

    1 is better everywhere, 1.5 equal, 2 worse everywhere. It is the leaderboards' rank aggregation;
    to rank models of several logs, import them into a service.
    """

    def compute(scores: list[SampleScore]) -> Value:
        experts, samples = references(), _by_task(scores)
        tasks = [task for task in samples if task in experts]
        if not tasks:
            return {}
        rates = [[_rate(samples[task]), 1.0] for task in tasks]
        figures = [[round(_mean(samples[task]), DIGITS), experts[task]] for task in tasks]
        return {"mean_rank": float(mean_ranks(np.array(rates), np.array(figures))[0])}

    return compute


def _by_task(scores: list[SampleScore]) -> dict[str, list[SampleScore]]:
    tasks: dict[str, list[SampleScore]] = {}
    for sample in scores:
        tasks.setdefault(str((sample.score.metadata or {})["task"]), []).append(sample)
    return tasks


def _rate(scores: list[SampleScore]) -> float:
    return float(np.mean([bool((sample.score.metadata or {})["success"]) for sample in scores]))


def _mean(scores: list[SampleScore]) -> float:
    return float(np.mean([sample.score.as_float() for sample in scores]))
