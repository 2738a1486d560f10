"""Records of jobs: machines, trials, explanations, some only after the job's end."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Final

from sqlalchemy.exc import SQLAlchemyError

from buildarena_api.http.problems import ErrorCode, ProblemError
from buildarena_api.schemas import WorldView
from buildarena_backend.errors import UnknownIdError
from buildarena_backend.jobs.job import Job
from buildarena_backend.process.context import Context
from buildarena_backend.states import JobState
from buildarena_backend.trials.scoring import find_task, scored_worlds
from buildarena_benchmark import Task
from buildarena_benchmark.outcomes import SIMULATED, Outcome
from buildarena_benchmark.scores import explain
from buildarena_geometry import DocumentError, Machine

_ENDED: Final = {
    Outcome.CONSTRUCTION_FAILED: "The machine was not finished",
    Outcome.LIMIT: "The session reached a limit that its owner set, so the job counts nowhere",
    Outcome.EXCLUDED: "The paper's protocol leaves it out",
    Outcome.ERRORED: "The service failed, so the job counts nowhere",
    Outcome.CANCELLED: "The job was cancelled",
}


def require_ended(context: Context, job: Job) -> None:
    """Refuse a trial's records while its job may still gain by them.

    Trajectories contain the gravity and the cargo's mass, which are hidden in some tasks.

    Raises:
        ProblemError: The job is under way, and its task has hidden parameters.
    """
    if job.state == JobState.DONE:
        return
    task = context.tasks.exact(job.task, job.task_version)
    if task is None or task.hidden_parameters is not None:
        detail = f"trajectories of job {job.id} are available once it has ended"
        raise ProblemError(ErrorCode.RESULT_WITHHELD, detail)


def no_artifact(job_id: str, artifact: str) -> ProblemError:
    """Return the problem of a request for an artifact that a job does not have."""
    return ProblemError(ErrorCode.ARTIFACT_NOT_FOUND, f"job {job_id} has no {artifact} yet")


def machine_hash(context: Context, job: Job) -> str:
    """Return the hash of a job's machine document.

    Raises:
        ProblemError: It has none yet.
    """
    digest = context.store.jobs.artifacts(job.id).get("machine")
    if digest is None:
        raise no_artifact(job.id, "machine")
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
        ProblemError: It was replaced.
    """
    task = context.tasks.exact(job.task, job.task_version)
    if task is None:
        detail = f"task {job.task} is no longer at version {job.task_version}"
        raise ProblemError(ErrorCode.TASK_NOT_FOUND, detail)
    return task


def explain_job(job: Job, worlds: Sequence[WorldView]) -> str | None:
    """Explain a job's result, with the distance to success; None until it has ended."""
    if job.outcome is None:
        return None
    outcome = Outcome(job.outcome)
    if outcome == Outcome.EXCLUDED and worlds:
        return f"{_ENDED[outcome]} as hacked. {worlds[0].explanation}"
    if outcome not in SIMULATED:
        cause = job.detail or (job.reason or "").replace("_", " ")
        return f"{_ENDED[outcome]}{': ' if cause else ''}{cause.rstrip('.')}."
    if not worlds:
        return None
    if len(worlds) == 1:
        return worlds[0].explanation
    passed = sum(world.success for world in worlds)
    return f"It passed {passed} of {len(worlds)} worlds. In the exact one: {worlds[0].explanation}"


def preview_job(context: Context, job_id: str) -> tuple[str, str] | None:
    """Return a job's title and explanation, for links; None for an unknown id."""
    try:
        job = context.store.jobs.get(job_id)
        worlds, _ = read_trials(job, context)
    except (UnknownIdError, SQLAlchemyError):
        # The page itself reports the fault, and works without the database.
        return None
    task = context.tasks.exact(job.task, job.task_version)
    sentence = explain_job(job, worlds) or "This run has not ended."
    return f"{job.task if task is None else task.title} · {job.model}", sentence


def read_trials(job: Job, context: Context) -> tuple[list[WorldView], int]:
    """Return the trials that score a job, the exact world's first, and its used test trials."""
    drawn, records = find_task(job, context.tasks), context.store.rollouts.read(job.id)
    if drawn is None:
        return [], 0
    tests = sum(not record.final for record in records) if drawn.test_trials else 0
    was_tried = job.outcome in {*SIMULATED, Outcome.EXCLUDED}
    worlds = [
        WorldView(
            rollout=record.number,
            exact=record.seed is None,
            success=record.counts,
            indicator=record.score.indicator,
            flags=list(record.score.flags),
            explanation=explain(drawn, record.score),
        )
        for record in (scored_worlds(drawn, records) if was_tried else ())
    ]
    return worlds, tests
