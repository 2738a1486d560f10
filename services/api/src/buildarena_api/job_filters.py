"""Filters that select the jobs of lists and summaries."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Annotated

from fastapi import Depends, Query

from buildarena_api.dependencies import ContextDep, IdPrefix, Services, Track
from buildarena_api.http.problems import ErrorCode, invalid, require_each, unknown
from buildarena_backend.jobs.filters import JobFilter
from buildarena_backend.process.context import Context
from buildarena_backend.states import JobState, Outcome
from buildarena_benchmark.scoring.registry import known_flags

Words = Annotated[list[str] | None, Query(max_length=100)]


def job_filter(
    context: ContextDep,
    *,
    sweep: Annotated[Words, Query(description="Only jobs of one of these sweeps")] = None,
    task: Words = None,
    category: Annotated[Words, Query(description="Only on tasks of these categories")] = None,
    model: Words = None,
    track: Annotated[list[Track] | None, Query()] = None,
    task_version: Words = None,
    configuration: Annotated[
        Words, Query(description="Of the model: hash of its decoding and limits too")
    ] = None,
    state: Annotated[list[JobState] | None, Query()] = None,
    outcome: Annotated[list[Outcome] | None, Query()] = None,
    reason: Annotated[Words, Query(description="Class of the failure")] = None,
    flag: Annotated[Words, Query(description="Only jobs with one of these flags")] = None,
    min_indicator: Annotated[float | None, Query(allow_inf_nan=False)] = None,
    max_indicator: Annotated[float | None, Query(allow_inf_nan=False)] = None,
    text: Annotated[
        str | None,
        Query(
            min_length=1,
            max_length=100,
            description="Only with this text in id, task, model, reason or detail, in any case",
        ),
    ] = None,
    id_prefix: IdPrefix = None,
) -> JobFilter:
    """Return the filter that the query parameters describe.

    Raises:
        ProblemError: A category is unknown.
        NotFoundError: A sweep is unknown.
    """
    for sweep_id in sweep or ():
        context.store.sweeps.get(sweep_id)
    return JobFilter(
        sweep_ids=sweep,
        tasks=None if category is None else _tasks_of(context, category),
        flags=flag,
        id_prefix=id_prefix,
        indicator_min=min_indicator,
        indicator_max=max_indicator,
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
    """Return the names of the tasks of some categories."""
    tasks = context.tasks.newest().values()
    categories_known = sorted({task.category for task in tasks})
    require_each("category", categories, categories_known)
    return tuple(sorted(task.name for task in tasks if task.category in categories))


def require_known(services: Services, job_filter: JobFilter) -> None:
    """Refuse values that are in no job, and in nothing that a job could be submitted with.

    Raises:
        ProblemError: One is; it lists the choices.
    """
    context = services.context
    submittable: dict[str, Callable[[], Iterable[str]]] = {
        "task": context.tasks.newest,
        "model": lambda: services.registry.models,
        "flag": known_flags,
    }
    lists = {name: job_filter.values(name) for name in ("task", "model", "track", "reason")}
    for name, values in {**lists, "flag": job_filter.flags}.items():
        choices = list(submittable.get(name, list)()) if values else []
        for value in map(str, values or ()):
            if value not in choices:
                _require_used(context, name, value, choices)


def _require_used(context: Context, name: str, value: str, choices: Sequence[str]) -> None:
    jobs = context.store.jobs
    used = jobs.used_flags([value]) if name == "flag" else jobs.distinct(name)
    if value in used or not (choices or used):
        return
    if choices:
        raise unknown(name, value, list(dict.fromkeys([*choices, *used])))
    message = f"no job has the {name} {value!r}"
    raise invalid(name, message, choices=used, code=ErrorCode.UNKNOWN_NAME)
