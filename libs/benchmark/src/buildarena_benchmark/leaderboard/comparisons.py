"""Comparison of two models by the tests of a board that has these two alone."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from pydantic import BaseModel, ConfigDict

from buildarena_benchmark.leaderboard.cells import Cell
from buildarena_benchmark.leaderboard.overall import label_rows, overall_rows
from buildarena_benchmark.leaderboard.standings import Standing, TestCache, standings
from buildarena_benchmark.leaderboard.verdict import verdict_of
from buildarena_benchmark.statistics.proportions import difference_interval

Side = Literal["first", "second"]


class TaskComparison(BaseModel):
    """Two models on one task."""

    model_config = ConfigDict(frozen=True, use_attribute_docstrings=True)

    task: str
    successes: tuple[float, float]
    counted_jobs: tuple[int, int]
    difference: float
    """Success rate of the first minus that of the second."""
    ci_low: float
    """Lower end of its 95 % interval."""
    ci_high: float
    better: Side | None
    """The side that is better beyond chance, by success and indicator together."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """Two models on all tasks that both played.

    Attributes:
        sentence: Verdict over these tasks, for people; None where they share none.
    """

    tasks: Sequence[TaskComparison]
    sentence: str | None
    better: Side | None


def compare_models(first: Mapping[str, Cell], second: Mapping[str, Cell]) -> Comparison:
    """Compare two model configurations.

    The tests on the tasks and over them are one family, as on a board.

    Args:
        first: Cells of one configuration by task.
        second: Cells of another one.
    """
    pairs = {
        task: (first[task], second[task])
        for task in sorted(first.keys() & second.keys())
        if first[task].counted and second[task].counted
    }
    cells = {task: {cell.configuration: cell for cell in pair} for task, pair in pairs.items()}
    ranks = standings(cells, lambda _: True, TestCache(), lambda _: False)
    labels = label_rows(cell for pair in pairs.values() for cell in pair)
    verdict = verdict_of(overall_rows(cells, ranks.overall, labels), len(cells))
    configurations = [cell.configuration for pair in pairs.values() for cell in pair][:2]
    return Comparison(
        tasks=[
            _compare_cells(task, *pair, better=_better(ranks.tasks[task], configurations))
            for task, pair in pairs.items()
        ],
        sentence=verdict.sentence if verdict else None,
        better=_better(ranks.overall, configurations),
    )


def _better(standing: Standing | None, configurations: Sequence[str]) -> Side | None:
    if standing is None:
        return None
    first, second = (list(standing.names).index(name) for name in configurations)
    better = standing.ranking.better
    return "first" if better[first, second] else "second" if better[second, first] else None


def _compare_cells(task: str, first: Cell, second: Cell, *, better: Side | None) -> TaskComparison:
    low, high = difference_interval(
        (first.successes, first.counted), (second.successes, second.counted)
    )
    return TaskComparison(
        task=task,
        successes=(first.successes, second.successes),
        counted_jobs=(first.counted, second.counted),
        difference=first.successes / first.counted - second.successes / second.counted,
        ci_low=low,
        ci_high=high,
        better=better,
    )
