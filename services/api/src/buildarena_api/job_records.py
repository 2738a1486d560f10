"""Records of jobs, and those withheld while a job runs."""

from __future__ import annotations

import json

from buildarena_api.http.problems import ErrorCode, ProblemError
from buildarena_backend.jobs.job import Job
from buildarena_backend.process.context import Context
from buildarena_backend.states import JobState
from buildarena_benchmark import Task
from buildarena_geometry import DocumentError, Machine


def require_told(context: Context, job: Job) -> None:
    """Refuse a trial's records while its job may still gain by them.

    Trajectories hold the gravity and the cargo's mass, which some tasks draw and do not tell.

    Raises:
        ProblemError: The job is under way, and its task has numbers that are not told.
    """
    if job.state == JobState.DONE:
        return
    task = context.tasks.exact(job.task, job.task_version)
    if task is None or task.unknowns is not None:
        detail = f"trajectories of job {job.id} are available once it has ended"
        raise ProblemError(ErrorCode.RESULT_WITHHELD, detail)


def missing(job_id: str, what: str) -> ProblemError:
    """Return the answer to whoever asks for what a job does not have."""
    return ProblemError(ErrorCode.ARTIFACT_NOT_FOUND, f"job {job_id} has no {what} yet")


def machine_hash(context: Context, job: Job) -> str:
    """Return the hash of a job's machine document.

    Raises:
        ProblemError: It has none yet.
    """
    digest = context.store.jobs.artifacts(job.id).get("machine")
    if digest is None:
        raise missing(job.id, "machine")
    return digest


def machine_of(context: Context, digest: str, job: Job) -> Machine:
    """Return the machine of a job's document.

    Raises:
        ProblemError: This version does not read it.
    """
    try:
        return Machine.from_document(json.loads(context.artifacts.get(digest)))
    except DocumentError as error:
        detail = f"job {job.id} has a machine that this version does not read: {error}"
        raise ProblemError(ErrorCode.ARTIFACT_NOT_FOUND, detail) from error


def task_of(context: Context, job: Job) -> Task:
    """Return the task of a job in its version.

    Raises:
        ProblemError: It is no longer there.
    """
    task = context.tasks.exact(job.task, job.task_version)
    if task is None:
        detail = f"task {job.task} is no longer at version {job.task_version}"
        raise ProblemError(ErrorCode.TASK_NOT_FOUND, detail)
    return task
