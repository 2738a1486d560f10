"""Drives: a person holds a machine's keys while it is simulated, and its job has them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from sqlalchemy import Connection

from buildarena_benchmark import Task, ValidationIssue, broken_constraint
from buildarena_geometry import KeyPress, Machine
from buildarena_pipeline.agents.sessions import AGENT_NAME, SessionClosedError
from buildarena_pipeline.agents.submission import chosen_task, submit_machine
from buildarena_pipeline.catalog.tracks import piloted_track
from buildarena_pipeline.errors import SubmissionError
from buildarena_pipeline.runtime.context import Context
from buildarena_pipeline.runtime.scoring import drawn_for
from buildarena_pipeline.runtime.simulators.known import simulation_version
from buildarena_pipeline.runtime.tracing import current_traceparent
from buildarena_store import Job, JobKey, NewJob
from buildarena_store.accounts.names import claim_name
from buildarena_store.jobs.job import configuration_hash
from buildarena_store.states import EXTERNAL_PROVIDER


@dataclass(frozen=True, slots=True, kw_only=True)
class OpenedDrive:
    """A drive that stands on a leaderboard when it ends, however it ends.

    Attributes:
        job: Its job.
        task: Its task, with what is drawn for the job.
    """

    job: Job
    task: Task


def drivable_task(context: Context, machine: Machine, *, task: str, simulator: str) -> Task:
    """The task that a machine is driven on.

    Raises:
        SubmissionError: There is no such task or simulator, or the machine breaks the task's rules.
    """
    chosen = chosen_task(context, task, simulator)
    broken = broken_constraint(chosen, machine)
    if broken is not None:
        raise SubmissionError([ValidationIssue(path="machine", message=broken[1])])
    return chosen


def open_drive(
    context: Context,
    machine: Machine,
    *,
    task: str,
    simulator: str,
    driver: str,
    owner: str | None = None,
    force: bool = False,
) -> OpenedDrive:
    """Opens the job of a drive, before anything of it is seen.

    A driver's drives of a task are counted: each has the next seed.

    Args:
        context: The process' connections.
        machine: The machine.
        task: The task's name.
        simulator: The simulator's name.
        driver: The driver's name, which is the key's from now on.
        owner: Id of the API key; None for the operator.
        force: Drive under another key's name, as an admin may.

    Raises:
        SubmissionError: As of `drivable_task`, or it is no name.
        NameTakenError: The name is another key's, or an agent's.
    """
    if not AGENT_NAME.fullmatch(driver):
        message = "1 to 80 letters, digits, dots, dashes and underscores"
        raise SubmissionError([ValidationIssue(path="driver", message=message)])
    chosen = drivable_task(context, machine, task=task, simulator=simulator)
    model = f"human/{driver}"
    config = {"name": model, "provider": EXTERNAL_PROVIDER, "model": driver}
    track = piloted_track(simulator, simulation_version(context, simulator))
    with context.store.database.transaction() as connection:
        # Two drives of one name wait for each other here.
        claim_name("human", driver, owner=owner, connection=connection, force=force)
        key = JobKey(
            task=task,
            task_version=chosen.version,
            model_hash=configuration_hash(config, {}),
            track=track.id,
            seed=0,
        )
        seed = context.store.jobs.next_seed(key, connection=connection)
        key = replace(key, seed=seed)
        new = NewJob(
            key=key,
            model=model,
            model_config=config,
            track_config=track.as_config(),
            owner=owner,
            traceparent=current_traceparent(),
        )
        context.store.jobs.add([new], connection=connection)
        context.store.external_calls.open(key.job_id, connection=connection)
    job = context.store.jobs.get(key.job_id)
    return OpenedDrive(job=job, task=drawn_for(job, chosen))


def submit_drive(
    context: Context, job_id: str, machine: Machine, presses: Sequence[KeyPress]
) -> Job:
    """Ends a drive: the machine is simulated again with the keys that were held, and scored.

    Args:
        context: The process' connections.
        job_id: The drive's job.
        machine: The machine.
        presses: The keys that were held.

    Raises:
        SessionClosedError: The job is not open any more.
    """
    with context.store.database.transaction() as connection:
        queue = _submit(
            context, job_id, machine.with_control_sequence(presses), connection=connection
        )
    if queue is not None:
        context.queues.announce(queue, [job_id])
    return context.store.jobs.get(job_id)


def _submit(
    context: Context, job_id: str, machine: Machine, *, connection: Connection
) -> str | None:
    lease = context.store.external_calls.lease(job_id, connection=connection)
    if lease is None:
        raise SessionClosedError(f"drive {job_id} is not open: it was cancelled")
    return submit_machine(context, lease, machine, None, connection=connection)
