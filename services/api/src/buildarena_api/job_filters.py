"""Which jobs a request means: the filters of lists and of what is counted over them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from fastapi import Depends, Query

from buildarena_api.board_filters import unknown
from buildarena_api.dependencies import ContextDep, IdPrefix, Track
from buildarena_api.http.problems import ProblemError
from buildarena_api.schemas import AnyJobState, AnyOutcome
from buildarena_backend.catalog.models import ModelRegistry
from buildarena_backend.jobs.filters import JobFilter
from buildarena_backend.process.context import Context
from buildarena_benchmark import ValidationIssue
from buildarena_benchmark.scoring.registry import known_flags


def job_filter(
    context: ContextDep,
    *,
    sweep: Annotated[str | None, Query(description="Only this sweep's jobs")] = None,
    task: Annotated[str | None, Query()] = None,
    category: Annotated[
        list[str] | None, Query(description="Only jobs on tasks of these categories")
    ] = None,
    model: Annotated[str | None, Query()] = None,
    track: Annotated[Track | None, Query()] = None,
    task_version: Annotated[str | None, Query()] = None,
    configuration: Annotated[
        str | None, Query(description="Of the model: hash of its decoding and limits too")
    ] = None,
    state: Annotated[AnyJobState | None, Query()] = None,
    outcome: Annotated[AnyOutcome | None, Query()] = None,
    reason: Annotated[str | None, Query(description="Class of the failure")] = None,
    flag: Annotated[str | None, Query(description="Only jobs with this flag")] = None,
    indicator_min: Annotated[
        float | None, Query(allow_inf_nan=False, description="Only with at least this indicator")
    ] = None,
    indicator_max: Annotated[
        float | None, Query(allow_inf_nan=False, description="Only with at most this indicator")
    ] = None,
    text: Annotated[
        str | None,
        Query(
            min_length=1,
            max_length=100,
            description="Only jobs in whose id, task, model, reason or detail it stands, in any "
            "case",
        ),
    ] = None,
    id_prefix: IdPrefix = None,
) -> JobFilter:
    """What the parameters mean.

    Raises:
        ProblemError: A category is unknown.
        NotFoundError: The sweep is unknown.
    """
    if sweep is not None:
        context.store.sweeps.get(sweep)
    return JobFilter(
        sweep_id=sweep,
        tasks=None if category is None else _tasks_of(context, category),
        flag=flag,
        id_prefix=id_prefix,
        indicator_min=indicator_min,
        indicator_max=indicator_max,
        text=text,
        equals={
            "task": task,
            "task_version": task_version,
            "model": model,
            "model_hash": configuration,
            "track": track,
            "state": state,
            "outcome": outcome,
            "reason": reason,
        },
    )


JobFilterDep = Annotated[JobFilter, Depends(job_filter)]


def _tasks_of(context: Context, categories: Sequence[str]) -> tuple[str, ...]:
    """Names of the tasks of some categories."""
    tasks = context.tasks.newest().values()
    known = sorted({task.category for task in tasks})
    for name in categories:
        if name not in known:
            raise unknown("category", name, known)
    return tuple(sorted(task.name for task in tasks if task.category in categories))


def require_known(context: Context, registry: ModelRegistry, wanted: JobFilter) -> None:
    """Refuses values that are in no job, and in nothing that a job could be submitted with.

    Raises:
        ProblemError: One is; it lists the choices.
    """
    given = {name: wanted.equals.get(name) for name in ("task", "model", "track", "reason")}
    for name, value in {**given, "flag": wanted.flag}.items():
        if value is not None:
            _require_known(context, registry, name, str(value))


def _require_known(context: Context, registry: ModelRegistry, name: str, value: str) -> None:
    known = {
        "task": lambda: list(context.tasks.newest()),
        "model": lambda: list(registry.models),
        "flag": lambda: list(known_flags()),
    }
    choices = known.get(name, list)()
    if value in choices:
        return
    if name == "flag":
        used = context.store.jobs.used_flags([value])
    else:
        used = context.store.jobs.distinct(name)
    if value in used or not (choices or used):
        return
    if choices:
        raise unknown(name, value, list(dict.fromkeys([*choices, *used])))
    message = f"no job has the {name} {value!r}"
    problem = ValidationIssue(path=name, message=message, choices=tuple(used))
    raise ProblemError(422, f"{name}: {message}", errors=[problem])
