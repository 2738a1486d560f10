"""What a board's figures are answered with: the same that reports are drawn from."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from buildarena_backend.boards.tallying import CellRecord
from buildarena_backend.boards.trials import CellId
from buildarena_benchmark import Task
from buildarena_benchmark.leaderboard import Board, OverallRow, Tally, cost_bins_of, failure_row

Whole = Annotated[int, BeforeValidator(round)]


class _View(BaseModel):
    model_config = ConfigDict(from_attributes=True)


class FailureRow(_View):
    """How the jobs of one model configuration ended."""

    model: str
    configuration: str
    outcomes: dict[str, int] = Field(
        description="Ended jobs by outcome, with its reason where there is one",
        examples=[{"success": 4, "construction_failed: objection": 1}],
    )
    refusals: dict[str, int] = Field(description="Refused actions by class")
    actions: int
    refused_actions: int


class CostBin(_View):
    """Jobs whose sessions wrote about as much."""

    min_output_tokens: Whole = Field(validation_alias="low")
    max_output_tokens: Whole = Field(validation_alias="high")
    counted: int = Field(validation_alias="trials")
    mean: float | None = Field(description="Of the performance; the task's best job has 1")
    median: float | None


class CategoryCost(BaseModel):
    """Performance in bins of output tokens, over the tasks of a category."""

    category: str
    bins: list[CostBin]


class FrontPoint(_View):
    """One model configuration's cost and performance over all tasks."""

    model: str
    configuration: str
    mean_rank: float | None = Field(
        description="The smaller, the better; null if a task is missing"
    )
    success_rate_mean: float | None
    cost_usd_mean: float | None
    output_tokens_mean: float | None
    pareto: bool = Field(description="No other model is both better and cheaper")


class DifficultyScores(_View):
    """Scores along the difficulty dimensions, from 0 (last on every task) to 1 (first)."""

    model: str
    configuration: str
    dimensions: dict[str, float]


class Figures(BaseModel):
    """What a board's figures are drawn from."""

    track: str | None
    dimensions: list[DifficultyScores] = Field(description="Ranked configurations, the best first")
    failures: list[FailureRow]
    cost: list[CategoryCost]
    front: list[FrontPoint] = Field(description="Cost against performance, the best first")


def figures_view(
    track: str,
    board: Board,
    cells: Mapping[CellId, CellRecord],
    *,
    tasks: Mapping[str, Task],
) -> Figures:
    """The figures of a ranked board.

    Args:
        track: Its track.
        board: The board.
        cells: Its cells.
        tasks: Every task by name.
    """
    by_task: dict[str, list[Tally]] = {}
    by_row: dict[tuple[str, str], list[Tally]] = {}
    for id_, cell in sorted(cells.items()):
        by_task.setdefault(id_.task, []).extend(cell.tallies)
        by_row.setdefault((cell.model, id_.configuration), []).extend(cell.tallies)
    categories = {name: task.category for name, task in tasks.items()}
    found = cost_bins_of(by_task, categories=categories)
    failures = [failure_row(*row, tallies) for row, tallies in sorted(by_row.items())]
    return Figures(
        track=track,
        dimensions=[DifficultyScores.model_validate(row) for row in _with_dimensions(board)],
        failures=[FailureRow.model_validate(row) for row in failures],
        cost=[
            CategoryCost(category=name, bins=[CostBin.model_validate(one) for one in bins])
            for name, bins in sorted(found.items())
        ],
        front=[FrontPoint.model_validate(row) for row in board.overall],
    )


def _with_dimensions(board: Board) -> list[OverallRow]:
    return [row for row in board.overall if row.dimensions]
