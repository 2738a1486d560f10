"""Response models of the leaderboard."""

from __future__ import annotations

from functools import cache
from urllib.parse import quote_plus

from pydantic import Field

from buildarena_api.schemas import View
from buildarena_backend.catalog.models import ModelRegistry
from buildarena_backend.catalog.tasks import TaskCatalog
from buildarena_benchmark import Task, builtin_tasks
from buildarena_benchmark.leaderboard import Board as RankedBoard
from buildarena_benchmark.leaderboard import (
    CellFigures,
    OverallRow,
    RankedCell,
    RankingVerdict,
    verdict_of,
)
from buildarena_benchmark.scoring.flags import Flag
from buildarena_benchmark.scoring.registry import known_flags


class BoardRow(CellFigures):
    """A model configuration on one task. What does not exist is null."""

    label: str
    """The model, with the settings that differ where it has several configurations."""
    rank: int | None
    """Statistically tied models share a rank."""
    rank_low: int | None
    """Lower end of the place's interval; all of a board's hold together at 95 %."""
    rank_high: int | None
    baseline: bool
    """A built-in model for comparison."""
    jobs: str
    """Path of the list of its jobs."""


class TaskBoard(View):
    """All models on one task, the best first."""

    task: str
    version: str
    custom: bool
    """Whether the task was uploaded."""
    outdated: int
    """Ended jobs of other versions, which are left out."""
    indicator: str
    unit: str
    rows: list[BoardRow]


class Board(View):
    """The leaderboard of one track."""

    track: str | None
    """null when no job has ended."""
    tracks: list[str]
    """Every track with ended jobs."""
    flags: list[Flag] = Field(default_factory=lambda: [*known_flags().values()])
    tasks: list[TaskBoard]
    overall: list[OverallRow] = Field(default=[])
    ranked: list[str] = Field(default=[])
    """Tasks that `overall` is over."""
    verdict: RankingVerdict | None = None
    """null when `overall` has no row."""


def board_view(
    board: RankedBoard,
    *,
    track: str,
    tracks: list[str],
    registry: ModelRegistry,
    catalogue: TaskCatalog,
) -> Board:
    """Return the response for a ranked board."""
    newest = catalogue.select({entry.task for entry in board.tasks})
    tasks = {
        entry.task: catalogue.exact(entry.task, entry.version) or newest.get(entry.task)
        for entry in board.tasks
    }

    versions = {entry.task: entry.version for entry in board.tasks}

    # A board of 450 rows names the same few dozen words again and again.
    quoted = cache(quote_plus)

    def row(ranked: RankedCell, task: str) -> BoardRow:
        cell = ranked.cell
        query = f"task={quoted(task)}&model={quoted(cell.model)}"
        version_query = (
            f"track={quoted(track)}&task_version={quoted(versions[task])}"
            f"&configuration={quoted(cell.configuration)}"
        )
        return BoardRow.model_validate(
            {
                **dict(cell),
                **{n: getattr(ranked, n) for n in ("label", "rank", "rank_low", "rank_high")},
                "baseline": registry.is_baseline(cell.model),
                "jobs": f"/v1/jobs?{query}&{version_query}",
            }
        )

    return Board(
        track=track,
        tracks=tracks,
        tasks=[
            TaskBoard(
                task=entry.task,
                version=entry.version,
                custom=entry.task not in builtin_tasks(),
                outdated=entry.outdated,
                **_figure(tasks[entry.task]),
                rows=[row(ranked, entry.task) for ranked in entry.rows],
            )
            for entry in board.tasks
        ],
        overall=[
            row.model_copy(update={"baseline": registry.is_baseline(row.model)})
            for row in board.overall
        ],
        ranked=list(board.ranked),
        verdict=verdict_of(board.overall, len(board.ranked)),
    )


def _figure(task: Task | None) -> dict[str, str]:
    """Return name and unit of the rows' indicator."""
    if task is None:
        return {"indicator": "indicator", "unit": ""}
    return {"indicator": task.indicator.name, "unit": task.indicator.unit}
