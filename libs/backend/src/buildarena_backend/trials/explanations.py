"""One sentence on how a job ended, for builders and for visitors of pages."""

from __future__ import annotations

from typing import Final

from buildarena_backend.catalog.tasks import TaskCatalog
from buildarena_backend.jobs.job import Job
from buildarena_benchmark import Score
from buildarena_benchmark.outcomes import SIMULATED, Outcome
from buildarena_benchmark.scores import explain

_ENDED: Final = {
    Outcome.CONSTRUCTION_FAILED: "The machine was not finished",
    Outcome.LIMIT: "The session reached one of the job's limits",
    Outcome.ERRORED: "The service failed, so the job counts nowhere",
    Outcome.CANCELLED: "The job was cancelled",
}


def explain_job(job: Job, tasks: TaskCatalog) -> str | None:
    """Return what happened and by how much it missed; None while the job has not ended.

    Args:
        job: The job.
        tasks: Gives the version of the task that it was submitted for.
    """
    if job.outcome is None:
        return None
    outcome = Outcome(job.outcome)
    if outcome not in SIMULATED:
        why = job.detail or (job.reason or "").replace("_", " ")
        return f"{_ENDED[outcome]}{': ' if why else ''}{why.rstrip('.')}."
    task = tasks.exact(job.task, job.task_version)
    if task is None or job.indicator is None:
        return None
    found = Score(
        success=bool(job.success),
        indicator=job.indicator,
        metrics=dict(job.metrics or {}),
        flags=tuple(job.flags or ()),
    )
    return explain(task, found)
