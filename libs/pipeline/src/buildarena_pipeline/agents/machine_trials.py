"""Trials of machines that somebody brings as a file: on no leaderboard, and without a session."""

from __future__ import annotations

from hashlib import sha256
from typing import Final

from buildarena_geometry import Machine
from buildarena_geometry.machine_files import machine_bytes
from buildarena_pipeline.agents.submission import chosen_task, submit_machine
from buildarena_pipeline.catalog.tracks import file_track
from buildarena_pipeline.errors import PipelineError
from buildarena_pipeline.runtime.context import Context
from buildarena_pipeline.runtime.simulators.known import simulation_version
from buildarena_store import Job, JobKey, NewJob
from buildarena_store.jobs.files import files_under_way
from buildarena_store.jobs.job import configuration_hash
from buildarena_store.states import FILE_PROVIDER

MAX_OPEN: Final = 20
"""Trials of files that one owner may have waiting or running."""
NAME_LENGTH: Final = 12


class TooManyTrialsError(PipelineError):
    """The owner has as many trials of files under way as one may have."""


def request_trial(
    context: Context,
    machine: Machine,
    *,
    task: str,
    simulator: str,
    seed: int = 0,
    owner: str | None = None,
) -> tuple[Job, bool]:
    """Opens a job that puts a machine through a task's trial.

    An equal machine on the same task, simulator and seed gives the same job, whoever asks.

    Args:
        context: The process' connections.
        machine: The machine; how it came about plays no part.
        task: The task's name.
        simulator: The simulator's name.
        seed: The seed.
        owner: Id of the API key; None for the operator.

    Returns:
        The job, and whether it is new.

    Raises:
        SubmissionError: The task or the simulator is unknown.
        TooManyTrialsError: Too many are under way.
    """
    chosen = chosen_task(context, task, simulator)
    digest = sha256(machine_bytes(machine)).hexdigest()
    name = f"file/{digest[:NAME_LENGTH]}"
    config = {"name": name, "provider": FILE_PROVIDER, "model": digest}
    track = file_track(simulator, simulation_version(context, simulator))
    key = JobKey(
        task=task,
        task_version=chosen.version,
        model_hash=configuration_hash(config, {}),
        track=track.id,
        seed=seed,
    )
    new = NewJob(
        key=key, model=name, model_config=config, track_config=track.as_config(), owner=owner
    )
    queue = None
    with context.store.database.transaction() as connection:
        context.store.jobs.add([new], connection=connection)
        fresh = context.store.external_calls.open(key.job_id, connection=connection)
        if fresh:
            if files_under_way(owner, connection=connection) > MAX_OPEN:
                raise TooManyTrialsError(
                    f"{MAX_OPEN} trials of files are under way, as many as one key may have: wait "
                    "for some to end"
                )
            lease = context.store.external_calls.lease(key.job_id, connection=connection)
            if lease is None:
                raise RuntimeError(f"job {key.job_id} was opened and is not open")
            queue = submit_machine(context, lease, machine, None, connection=connection)
    if queue is not None:
        context.queues.announce(queue, [key.job_id])
    return context.store.jobs.get(key.job_id), fresh
