"""Access to a service from notebooks: boards and jobs as frames, machines and trials."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, Unpack

from buildarena_client import Client, ClientError, jobs_frame, leaderboard_frame

if TYPE_CHECKING:
    from buildarena.machines import Machine
    from buildarena.trials import Trial
    from buildarena_client.frames import Kind
    from buildarena_client.schemas import BoardFilters, JobDetail, JobFilters

MACHINE = "machine"


def leaderboard(
    url: str | None = None,
    *,
    overall: bool = False,
    kind: Kind = "pandas",
    **filters: Unpack[BoardFilters],
) -> Any:
    """Return a service's leaderboard as a frame: a row for each model on each task.

    Args:
        url: Base URL of the service; by default BUILDARENA_URL, or this machine. The key is read
            from BUILDARENA_KEY or BUILDARENA_KEY_FILE.
        overall: Whether to return one row for each model over all tasks.
        kind: ``pandas`` or ``polars``.
        filters: Filters of the counted jobs: ``track``, ``task``, ``model``, ``sweep``, …

    Raises:
        ClientError: The service does not answer, or refuses; or the library is not installed.
    """
    with Client(url) as client:
        return leaderboard_frame(client.leaderboard(**filters), overall=overall, kind=kind)


def jobs(
    url: str | None = None,
    *,
    limit: int | None = None,
    kind: Kind = "pandas",
    **filters: Unpack[JobFilters],
) -> Any:
    """Return the jobs of a service as a frame, a row for each, the newest first.

    Args:
        url: See `leaderboard`.
        limit: Maximum number of jobs; all by default.
        kind: ``pandas`` or ``polars``.
        filters: Filters of the jobs: ``sweep``, ``task``, ``model``, ``outcome``, …

    Raises:
        ClientError: The service does not answer, or refuses; or the library is not installed.
    """
    with Client(url) as client:
        return jobs_frame(client.jobs(limit=limit, **filters), kind=kind)


def job_machine(job_id: str, url: str | None = None) -> Machine:
    """Return the machine that a job built, for display or further building.

    Args:
        url: See `leaderboard`.

    Raises:
        ClientError: The job is unknown or has no machine, or the service does not answer.
        DocumentError: The machine has an unsupported format.
    """
    with Client(url) as client:
        return _machine(client, job_id, client.job(job_id))


def job_trial(job_id: str, url: str | None = None) -> Trial:
    """Return the trial that determined a job's score, for playback.

    Args:
        url: See `leaderboard`.

    Raises:
        ClientError: The job is unknown or was not simulated, or the service does not answer.
        DocumentError: The machine has an unsupported format.
        TrajectoryFormatError: The trajectory has an unsupported format.
    """
    from buildarena.trials import Trial
    from buildarena_benchmark import Score, parse_task
    from buildarena_simulation import read_trajectory

    with Client(url) as client:
        job = client.job(job_id)
        exact = next(iter(job["worlds"]), None)
        name = "" if exact is None else f"trajectory-{exact['rollout']}"
        if exact is None or name not in job["artifacts"]:
            ended = job["reason"] or job["outcome"] or job["state"]
            raise ClientError(f"{job_id} has no trial: {ended}")
        task = client.task(job["task"], version=job["task_version"])
        return Trial(
            task=parse_task(json.dumps(task["document"]), origin=f"task {job['task']}"),
            machine=_machine(client, job_id, job),
            score=Score(
                success=exact["success"],
                indicator=exact["indicator"],
                metrics=job["metrics"],
                flags=tuple(exact["flags"]),
            ),
            trajectory=read_trajectory(client.artifact(job_id, name)),
        )


def _machine(client: Client, job_id: str, job: JobDetail) -> Machine:
    from buildarena.machines import Machine

    if MACHINE not in job["artifacts"]:
        ended = job["reason"] or job["outcome"] or job["state"]
        raise ClientError(f"{job_id} has no machine: {ended}")
    return Machine.from_document(json.loads(client.artifact(job_id, MACHINE)))
