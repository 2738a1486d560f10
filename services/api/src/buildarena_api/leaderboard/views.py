"""Response models of the leaderboard."""

from __future__ import annotations

from datetime import datetime
from functools import cache
from operator import attrgetter
from typing import Any
from urllib.parse import quote_plus

from pydantic import Field

from buildarena_api.schemas import View
from buildarena_backend.catalog.models import ModelRegistry
from buildarena_backend.catalog.tasks import TaskCatalog
from buildarena_benchmark import Task, builtin_tasks
from buildarena_benchmark.leaderboard import Board as RankedBoard
from buildarena_benchmark.leaderboard import Cell, verdict_of
from buildarena_benchmark.scoring.registry import known_flags
from buildarena_benchmark.statistics import MIN_SUCCESSES


class BoardRow(View):
    """A model configuration on one task. What does not exist is null."""

    rank: int | None
    """Statistically tied models share a rank."""
    rank_low: int | None
    """Lower end of the place's interval; all of a board's hold together at 95 %."""
    rank_high: int | None
    model: str
    configuration: str
    """Hash of model, decoding and limits."""
    decoding: dict[str, Any]
    """How replies were sampled, and the limits of the sessions, if any."""
    baseline: bool
    """A built-in model for comparison."""
    counted: int = Field(validation_alias="trials")
    """Jobs that count: the denominator of the averages."""
    ended: int
    """All ended jobs, also errored and cancelled ones."""
    errored: int
    """Jobs that infrastructure faults ended: in no average."""
    cancelled: int
    flagged: int
    """Scored jobs that a flag makes failures."""
    flags: dict[str, int]
    """Scored jobs by flag."""
    by_runner: int
    """Jobs with a trial that a runner ran."""
    unverified: int
    """Jobs that wait for their verification, or were refuted: they count nowhere."""
    refuted: int
    """Jobs whose verification came to other figures."""
    simulated: int
    """Counted jobs whose machine was finished and simulated."""
    successes: float
    """Sum of the shares of worlds in which jobs succeed."""
    success_rate: float | None
    """null when nothing was scored."""
    success_low: float | None
    """Lower end of the 95 % exact interval."""
    success_high: float | None
    """Upper end of the 95 % exact interval."""
    success_rate_of_ended: float | None
    """Successes of all ended jobs."""
    indicator_mean: float | None
    indicator_low: float | None
    """Lower end of the 95 % interval; null when there are too few data."""
    indicator_high: float | None
    score: float | None
    """Mean of the jobs' indicators beside the built-in expert's on a log scale, log2(1 + indicator
    / expert's): 0 for nothing, 1 for as much as the expert, 2 for three times as much; it does not
    depend on who else is listed. null for a task without expert."""
    score_low: float | None
    """Lower end of its 95 % interval."""
    score_high: float | None
    too_few_data: bool = Field(
        description=f"Fewer than {MIN_SUCCESSES} successes: no interval of the mean indicator "
        "would hold"
    )
    indicator_best: float | None
    censored: int
    """Counted jobs that carried everything; if there are any, the mean and the best indicator are
    at least what they say."""
    parts_mean: float | None
    requests_mean: float | None
    input_tokens_mean: float | None
    output_tokens_mean: float | None
    cost_usd_mean: float | None
    cost_per_success_usd: float | None
    refused_action_rate: float | None = Field(validation_alias="invalid_action_rate")
    pass_at: dict[str, float]
    """Chance that one of k tries succeeds, by k."""
    pass_all: dict[str, float]
    """Chance that all of k tries succeed, by k."""
    outcomes: dict[str, int]
    reasons: dict[str, int]
    """Counted jobs that failed, by reason."""
    refusals: dict[str, int]
    """Refused actions by class."""
    last_finished_at: datetime | None = Field(validation_alias="newest")
    """When the last of its jobs ended."""
    jobs: str
    """Path of the list of its jobs."""


class TaskBoard(View):
    """All models on one task, the best first."""

    task: str
    version: str
    custom: bool
    """Whether somebody uploaded the task."""
    outdated: int
    """Ended jobs of other versions, which are left out."""
    indicator: str
    unit: str
    rows: list[BoardRow]


class OverallRow(View):
    """A model configuration over the built-in tasks of the board, or over those asked for."""

    rank: int | None
    """null when a task is missing."""
    rank_low: int | None
    rank_high: int | None
    mean_rank: float | None
    """Over tasks, by success rate and by indicator."""
    model: str
    configuration: str
    baseline: bool
    missing: list[str]
    """Tasks of the board without a counted job."""
    score_mean: float | None
    """Mean of the tasks' scores; null where a task or its expert is missing."""
    counted: int = Field(validation_alias="trials")
    success_rate_mean: float | None
    cost_usd_mean: float | None
    output_tokens_mean: float | None
    pareto: bool
    """No other model is both better and cheaper."""


class FlagView(View):
    """A flag that scores can have."""

    name: str
    disqualifying: bool
    """Whether its trials count as failures."""
    meaning: str


FLAGS = [FlagView.model_validate(flag, from_attributes=True) for flag in known_flags().values()]


class RankingVerdict(View):
    """Conclusion of the overall ranking, by the same tests as its ranks."""

    sentence: str
    """Who is best, and whether the trials show it; for people."""
    leaders: list[str]
    """Models that share the first rank; none when nobody is ranked or has succeeded."""
    proven: bool
    """Whether one model is better than every other ranked one beyond chance."""
    seeds_to_separate: int | None
    """Seeds of each model on each task that would tell the first two of several leaders apart, if
    their success rates stay as they are; null without a tie, and where more seeds would not
    help."""


class Board(View):
    """The leaderboard of one track."""

    track: str | None
    """null when no job has ended."""
    tracks: list[str]
    """Every track with ended jobs."""
    flags: list[FlagView] = Field(default_factory=lambda: FLAGS)
    tasks: list[TaskBoard]
    overall: list[OverallRow] = Field(default=[])
    ranked: list[str] = Field(default=[])
    """Tasks that `overall` is over."""
    verdict: RankingVerdict | None = None
    """null when `overall` has no row."""


_CELL = tuple(Cell.__dataclass_fields__)
_VALUES = attrgetter(*_CELL)


def board_view(
    board: RankedBoard,
    *,
    track: str,
    tracks: list[str],
    registry: ModelRegistry,
    catalogue: TaskCatalog,
) -> Board:
    """Return a ranked board as it is answered."""
    newest = catalogue.named({found.task for found in board.tasks})
    tasks = {
        found.task: catalogue.exact(found.task, found.version) or newest.get(found.task)
        for found in board.tasks
    }

    versions = {found.task: found.version for found in board.tasks}

    # A board of 450 rows names the same few dozen words again and again.
    quoted = cache(quote_plus)

    def is_baseline(model: str) -> bool:
        return model in registry.models and registry.models[model].baseline

    def row(ranked: Any, task: str) -> BoardRow:
        cell: Cell = ranked.cell
        query = f"task={quoted(task)}&model={quoted(cell.model)}"
        one = (
            f"track={quoted(track)}&task_version={quoted(versions[task])}"
            f"&configuration={quoted(cell.configuration)}"
        )
        return BoardRow.model_validate(
            {
                **dict(zip(_CELL, _VALUES(cell), strict=True)),
                "rank": ranked.rank,
                "rank_low": ranked.rank_low,
                "rank_high": ranked.rank_high,
                "baseline": is_baseline(cell.model),
                "jobs": f"/v1/jobs?{query}&{one}",
            }
        )

    verdict = verdict_of(board.overall, len(board.ranked), is_baseline)
    return Board(
        track=track,
        tracks=tracks,
        tasks=[
            TaskBoard(
                task=found.task,
                version=found.version,
                custom=found.task not in builtin_tasks(),
                outdated=found.outdated,
                **_figure(task),
                rows=[row(ranked, found.task) for ranked in found.rows],
            )
            for found, task in ((found, tasks[found.task]) for found in board.tasks)
        ],
        overall=[
            OverallRow.model_validate(
                {
                    **{name: getattr(place, name) for name in place.__dataclass_fields__},
                    "baseline": is_baseline(place.model),
                }
            )
            for place in board.overall
        ],
        ranked=list(board.ranked),
        verdict=None if verdict is None else RankingVerdict.model_validate(verdict),
    )


def _figure(task: Task | None) -> dict[str, str]:
    """Name and unit of what rows give as their indicator."""
    if task is None:
        return {"indicator": "indicator", "unit": ""}
    return {"indicator": task.indicator.name, "unit": task.indicator.unit}
