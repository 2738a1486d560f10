"""What reports are made of, and how their figures are spelled."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from buildarena_benchmark.flags import ScoringPolicy
from buildarena_benchmark.leaderboard import Cell, EndedJob, PublishedRow, published_rows
from buildarena_cli.terminal.output import in_words


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportTask:
    """A task as a report needs it.

    Attributes:
        name: Its name.
        version: The version whose results are reported.
        category: Tasks of one category are pooled.
        indicator: Name of the figure it is ranked by.
        unit: The figure's unit.
        published_metric: Name of what the published policy reads instead, if it does.
        difficulty: Weight of each difficulty dimension; empty if not stated.
        document: Its whole document, if it is a user's own.
    """

    name: str
    version: str
    category: str
    indicator: str
    unit: str
    published_metric: str | None
    difficulty: Mapping[str, int]
    document: Mapping[str, Any] | None = None

    def figure(self, policy: ScoringPolicy) -> str:
        """What a scoring policy reads, with its unit, in words."""
        if policy == ScoringPolicy.PUBLISHED and self.published_metric is not None:
            return self.published_metric
        return in_words(self.indicator, self.unit)


@dataclass(frozen=True, slots=True, kw_only=True)
class Material:
    """What a report is made of.

    Attributes:
        title: What was run.
        policy: The scoring policy: how flags are read.
        tasks: The tasks by name, the built-in ones first; also such as were not run.
        trials: Ended jobs; their models are named as rows of the report.
        rounds: Of each job by id, for each round: success and indicator.
        snapshots: The provider's name of each row's model.
        unfinished: Jobs that have not ended.
        verdicts: By task and machine, for each simulator that tried it: success and indicator.
    """

    title: str
    policy: ScoringPolicy
    tasks: Mapping[str, ReportTask]
    trials: Sequence[EndedJob]
    rounds: Mapping[str, Sequence[tuple[bool, float]]]
    snapshots: Mapping[str, str]
    unfinished: int
    verdicts: Mapping[tuple[str, str], Mapping[str, tuple[bool, float]]]


def percent(share: float | None) -> str:
    """A share for people."""
    return "-" if share is None else f"{100 * share:.1f} %"


def between(low: float | None, high: float | None, factor: float = 1.0) -> str:
    """An interval for people."""
    if low is None or high is None:
        return "-"
    return f"{factor * low:.1f}-{factor * high:.1f}"


def indicator_between(cell: Cell) -> str:
    """The interval of a cell's mean indicator for people."""
    return "too few data" if cell.too_few_data else between(cell.indicator_low, cell.indicator_high)


def paper_rows(
    cells: Mapping[str, Sequence[Cell]], snapshots: Mapping[str, str]
) -> dict[str, dict[str, PublishedRow]]:
    """The paper's rows by task and by the name that the same snapshot has in this report."""
    by_task: dict[str, dict[str, PublishedRow]] = {}
    for task, row in cells.items():
        by_snapshot = {paper.snapshot: paper for paper in published_rows().get(task, ())}
        names = {cell.model for cell in row}
        by_task[task] = {
            name: by_snapshot[snapshots[name]]
            for name in names
            if snapshots.get(name) in by_snapshot
        }
    return by_task
