"""The rows of one task's board: averages per model, with the interval of the success rate."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

SCORED = frozenset({"success", "unsuccessful", "construction_failed", "limit"})
"""Outcomes that count in the averages. Source: docs on outcomes; faults never count."""
Z95 = 1.959963984540054
"""The 97.5 % quantile of the standard normal distribution."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """One ended job of a task.

    Attributes:
        model: Model name.
        outcome: How the job ended.
        success: Whether it met the task's criterion.
        indicator: The task's performance indicator.
        parts: Parts of its machine, if there was one.
        requests: Model requests.
        input_tokens: Tokens sent.
        output_tokens: Tokens received.
        cost_usd: US dollars.
    """

    model: str
    outcome: str
    success: bool
    indicator: float
    parts: int | None
    requests: int
    input_tokens: int
    output_tokens: int
    cost_usd: float


@dataclass(frozen=True, slots=True, kw_only=True)
class TaskRow:
    """One model on one task; averages over its scored trials, None when there are none."""

    model: str
    trials: int
    errored: int
    successes: int
    success_rate: float | None
    success_low: float | None
    success_high: float | None
    indicator_mean: float | None
    parts_mean: float | None
    requests_mean: float | None
    input_tokens_mean: float | None
    output_tokens_mean: float | None
    cost_usd_mean: float | None


def task_rows(trials: Iterable[Trial]) -> list[TaskRow]:
    """The rows of a task, by success rate and then by indicator, the best first."""
    by_model: dict[str, list[Trial]] = {}
    for trial in trials:
        by_model.setdefault(trial.model, []).append(trial)
    rows = [_row(model, found) for model, found in by_model.items()]
    return sorted(
        rows,
        key=lambda row: (-(row.success_rate or 0.0), -(row.indicator_mean or 0.0), row.model),
    )


def wilson_interval(successes: int, trials: int) -> tuple[float, float]:
    """The 95 % Wilson score interval of a success rate; it never leaves [0, 1].

    Source: E. B. Wilson, J. Am. Stat. Assoc. 22 (1927) 209, equation for p.
    """
    rate, square = successes / trials, Z95**2
    centre = (rate + square / (2 * trials)) / (1 + square / trials)
    spread = math.sqrt(rate * (1 - rate) / trials + square / (4 * trials**2))
    half = Z95 * spread / (1 + square / trials)
    return max(0.0, centre - half), min(1.0, centre + half)


def _row(model: str, trials: Sequence[Trial]) -> TaskRow:
    scored = [trial for trial in trials if trial.outcome in SCORED]
    successes = sum(trial.success for trial in scored)
    low, high = wilson_interval(successes, len(scored)) if scored else (None, None)

    def mean(value: Callable[[Trial], float | None]) -> float | None:
        values = [v for v in map(value, scored) if v is not None]
        return math.fsum(values) / len(values) if values else None

    return TaskRow(
        model=model,
        trials=len(scored),
        errored=sum(trial.outcome == "errored" for trial in trials),
        successes=successes,
        success_rate=successes / len(scored) if scored else None,
        success_low=low,
        success_high=high,
        indicator_mean=mean(lambda t: t.indicator),
        parts_mean=mean(lambda t: t.parts),
        requests_mean=mean(lambda t: t.requests),
        input_tokens_mean=mean(lambda t: t.input_tokens),
        output_tokens_mean=mean(lambda t: t.output_tokens),
        cost_usd_mean=mean(lambda t: t.cost_usd),
    )
