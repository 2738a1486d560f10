"""Routes of the leaderboard."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query
from pydantic import BaseModel, ConfigDict, Field

from buildarena_api.dependencies import ContextDep, RegistryDep
from buildarena_api.problems import FieldProblem, ProblemError, problem_responses
from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.leaderboard import Trial, task_rows

router = APIRouter(prefix="/v1", tags=["leaderboard"])


class Row(BaseModel):
    """One model on one task."""

    model_config = ConfigDict(from_attributes=True)

    model: str
    baseline: bool = Field(description="A built-in model for comparison")
    trials: int = Field(description="Scored jobs: the denominator of the averages")
    errored: int = Field(description="Jobs that infrastructure faults ended: in no average")
    successes: int
    success_rate: float | None = Field(description="null when nothing was scored")
    success_low: float | None = Field(description="Lower end of the 95 % Wilson interval")
    success_high: float | None = Field(description="Upper end of the 95 % Wilson interval")
    indicator_mean: float | None
    parts_mean: float | None
    requests_mean: float | None
    input_tokens_mean: float | None
    output_tokens_mean: float | None
    cost_usd_mean: float | None


class TaskBoard(BaseModel):
    """All models on one task, the best first."""

    task: str
    indicator: str
    unit: str
    rows: list[Row]


class Board(BaseModel):
    """The leaderboard of one track."""

    track: str | None = Field(description="null when there are no jobs at all")
    tracks: list[str] = Field(description="Every track with jobs")
    tasks: list[TaskBoard]


@router.get("/leaderboard", responses=problem_responses(422, 503))
def leaderboard(
    context: ContextDep,
    registry: RegistryDep,
    track: Annotated[str | None, Query(description="Default: the first with jobs")] = None,
    task: Annotated[str | None, Query(description="Only this task")] = None,
) -> Board:
    """Ranks the models of one track on each task; tracks are never mixed."""
    tracks = context.results.tracks()
    if track is not None and track not in tracks:
        raise _unknown("track", track, tracks)
    tasks = builtin_tasks()
    if task is not None and task not in tasks:
        raise _unknown("task", task, sorted(tasks))
    chosen = track or (tracks[0] if tracks else None)
    if chosen is None:
        return Board(track=None, tracks=[], tasks=[])
    trials: dict[str, list[Trial]] = {}
    for job in context.results.ended(chosen):
        if task is None or job.task == task:
            trials.setdefault(job.task, []).append(
                Trial(
                    model=job.model,
                    outcome=job.outcome,
                    success=bool(job.success),
                    indicator=job.indicator or 0.0,
                    parts=(job.metrics or {}).get("parts"),
                    requests=job.requests,
                    input_tokens=job.input_tokens,
                    output_tokens=job.output_tokens,
                    cost_usd=float(job.cost_usd),
                )
            )
    boards = [
        TaskBoard(
            task=name,
            indicator=tasks[name].indicator.name if name in tasks else "indicator",
            unit=tasks[name].indicator.unit if name in tasks else "",
            rows=[
                Row.model_validate(
                    {
                        **{field: getattr(row, field) for field in row.__dataclass_fields__},
                        "baseline": row.model in registry.models
                        and registry.models[row.model].baseline,
                    }
                )
                for row in task_rows(found)
            ],
        )
        for name, found in sorted(trials.items())
    ]
    return Board(track=chosen, tracks=tracks, tasks=boards)


def _unknown(field: str, value: str, choices: list[str]) -> ProblemError:
    message = f"there is no {field} {value!r}"
    return ProblemError(
        422,
        f"{field}: {message}",
        errors=[FieldProblem(field=field, message=message, choices=choices)],
    )
