"""Trials of machines that somebody brings as a file: on no leaderboard, and without a session."""

from __future__ import annotations

from hashlib import sha256
from typing import Final

from buildarena_backend.agents.submission import chosen_task, single_job, submit_machine
from buildarena_backend.catalog.tracks import file_track
from buildarena_backend.jobs.files import require_room
from buildarena_backend.jobs.job import Job
from buildarena_backend.process.context import Context
from buildarena_backend.states import FILE_PROVIDER
from buildarena_backend.sweeps.claims import add_claim
from buildarena_backend.trials.known_simulators import simulation_version
from buildarena_geometry import Machine
from buildarena_geometry.machine_files import machine_bytes

NAME_LENGTH: Final = 12


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

    An equal machine on the same task, simulator and seed gives the same job, whoever asks; each who
    does has a claim on it, and it goes on until nobody has.

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
        TooManyFilesError: The owner has as many under way as one may have.
    """
    chosen = chosen_task(context, task, simulator)
    digest = sha256(machine_bytes(machine)).hexdigest()
    config = {
        "name": f"file/{digest[:NAME_LENGTH]}",
        "provider": FILE_PROVIDER,
        "model": digest,
    }
    track = file_track(simulator, simulation_version(context, simulator))
    new = single_job(chosen, config, track, seed=seed, owner=owner)
    (job_id,) = new.job_ids
    queue = None
    with context.store.lifecycle.submission() as connection:
        added = context.store.jobs.add([new], connection=connection)
        add_claim(job_id, owner, connection=connection)
        if added:
            require_room(owner, connection=connection)
        fresh = context.store.external_calls.open(job_id, connection=connection)
        if fresh:
            lease = context.store.external_calls.lease(job_id, connection=connection)
            if lease is None:
                raise RuntimeError(f"job {job_id} was opened and is not open")
            queue = submit_machine(context, lease, machine, None, connection=connection)
    if queue is not None:
        context.queues.wake(queue)
    return context.store.jobs.get(job_id), fresh
