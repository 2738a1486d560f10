"""The BuildArena paper's own figures, as marked reference rows: never ranked with ours.

They were measured in the game itself, with other prompts and other physics.
"""

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from types import MappingProxyType

from buildarena_benchmark.statistics.proportions import exact_interval


@dataclass(frozen=True, slots=True, kw_only=True)
class PublishedRow:
    """A model on one task, as the paper has it.

    Attributes:
        model: The paper's name of the model.
        snapshot: The provider's name of the snapshot.
        success_low: Lower end of the 95 % exact interval; the paper states none.
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
    """Return the paper's rows by task, in the paper's order.

    Source:
        Tables on performance, cost and open-weight models of the BuildArena paper.
    """
    text = resources.files("buildarena_benchmark.leaderboard").joinpath("published.csv").read_text()
    rows: dict[str, list[PublishedRow]] = {}
    for line in csv.DictReader(text.splitlines()):
        row = _row(line)
        rows.setdefault(row.task, []).append(row)
    return MappingProxyType({task: tuple(task_rows) for task, task_rows in rows.items()})


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
