"""What is not told of a job that is under way: figures from which its builder could read a draw."""

from __future__ import annotations

from buildarena_api.http.problems import ProblemError
from buildarena_backend.jobs.job import Job
from buildarena_backend.process.context import Context
from buildarena_backend.states import JobState


def require_told(context: Context, job: Job) -> None:
    """Refuses a trial's records while its job may still gain by them.

    Trajectories hold the gravity and the cargo's mass, which some tasks draw and do not tell.

    Raises:
        ProblemError: The job is under way, and its task has numbers that are not told.
    """
    if job.state == JobState.DONE:
        return
    task = context.tasks.exact(job.task, job.task_version)
    if task is None or task.unknowns is not None:
        raise ProblemError(404, f"job {job.id} tells its trajectories once it has ended")
