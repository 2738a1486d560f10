"""The BuildArena paper's own figures, as marked reference rows: never ranked with ours.

They were measured in the game itself, with other prompts and other physics.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from itertools import combinations
from types import MappingProxyType

import numpy as np

from buildarena_benchmark.statistics import (
    Ranking,
    Sample,
    adjusted,
    combined,
    exact_interval,
    pair_tests,
    rank_models,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class PublishedRow:
    """One model on one task, as the paper has it.

    Attributes:
        model: The paper's name of the model.
        snapshot: The provider's name of the snapshot.
        success_low: Lower end of the 95 % exact interval; the paper states none.
        success_high: Upper end of it.
        input_tokens_mean: None where the paper gives no cost.
    """

    task: str
    model: str
    snapshot: str
    trials: int
    successes: int
    success_rate: float
    success_low: float
    success_high: float
    indicator_mean: float
    parts_mean: float
    input_tokens_mean: float | None
    output_tokens_mean: float | None
    requests_mean: float | None


@cache
def published_rows() -> Mapping[str, Sequence[PublishedRow]]:
    """The paper's rows by task, in the paper's order.

    Source:
        Tables on performance, cost and open-weight models of the BuildArena paper.
    """
    text = resources.files("buildarena_benchmark.leaderboard").joinpath("published.csv").read_text()
    rows: dict[str, list[PublishedRow]] = {}
    for line in csv.DictReader(text.splitlines()):
        row = _row(line)
        rows.setdefault(row.task, []).append(row)
    return MappingProxyType({task: tuple(task_rows) for task, task_rows in rows.items()})


@cache
def published_overall() -> tuple[Sequence[str], Ranking]:
    """The paper's models in its order, and their ranking over its nine tasks.

    Mean ranks are of success rates and indicators. The paper gives no spread of its indicators,
    so who is better beyond chance rests on the success rates alone.
    """
    tasks = published_rows()
    models = [row.model for row in next(iter(tasks.values()))]
    by_name = [{row.model: row for row in rows} for rows in tasks.values()]
    table = [[rows[model] for model in models] for rows in by_name]
    success = np.array([[row.success_rate for row in rows] for rows in table])
    indicator = np.array([[row.indicator_mean for row in rows] for rows in table])
    tests = combined(
        [pair_tests(list(combinations([_trials(row) for row in rows], 2))) for rows in table]
    )
    return models, rank_models((success, indicator), tests, adjusted([tests])[0])


def _trials(row: PublishedRow) -> Sample:
    """The trials behind the counts, by success alone."""
    success = (np.arange(row.trials) < row.successes).astype(float)
    return Sample.of(np.stack([success, success], axis=1))


def _row(line: Mapping[str, str]) -> PublishedRow:
    trials = int(line["samples"])
    # Percentages are rounded to a tenth, which names the count without doubt.
    successes = round(float(line["success_rate_pct"]) / 100 * trials)
    low, high = exact_interval(successes, trials)
    return PublishedRow(
        task=f"{line['task']}-{line['level']}",
        model=line["model"],
        snapshot=line["snapshot"],
        trials=trials,
        successes=successes,
        success_rate=successes / trials,
        success_low=low,
        success_high=high,
        indicator_mean=float(line["indicator_mean"]),
        parts_mean=float(line["parts_mean"]),
        input_tokens_mean=_number(line["input_tokens_mean"]),
        output_tokens_mean=_number(line["output_tokens_mean"]),
        requests_mean=_number(line["requests_mean"]),
    )


def _number(text: str) -> float | None:
    return float(text) if text else None
