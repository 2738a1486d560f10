"""Submissions of people and agents: the chosen task, and a machine's way to its trial."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from hashlib import sha256
from typing import Any, Final

from sqlalchemy import Connection

from buildarena_backend.catalog.tracks import FILE_WORKFLOW, Track
from buildarena_backend.errors import SubmissionError
from buildarena_backend.jobs.files import require_room
from buildarena_backend.jobs.job import Job, NewJobs, configuration_hash
from buildarena_backend.journal.rollouts import RolloutRequest
from buildarena_backend.journal.transcript import Transcript
from buildarena_backend.leases.leases import Lease
from buildarena_backend.process.context import Context
from buildarena_backend.states import FILE_PROVIDER, Outcome, Stage, simulate_queue
from buildarena_backend.sweeps.claims import add_claim
from buildarena_backend.telemetry.tracing import current_traceparent
from buildarena_backend.trials.known_simulators import simulation_version, simulator_issues
from buildarena_backend.trials.scoring import failure_score, task_of
from buildarena_backend.trials.simulator import BESIEGE
from buildarena_benchmark import Task, ValidationIssue, broken_constraint
from buildarena_geometry import Machine
from buildarena_geometry.machine_files import machine_bytes

JSON: Final = "application/json"


def resolve_task(
    context: Context, task: str, simulator: str, *, more_issues: Sequence[ValidationIssue] = ()
) -> Task:
    """Return the newest version of a task, if everything that was named exists.

    Raises:
        SubmissionError: Something is wrong; it names all of it.
    """
    chosen = context.tasks.select([task]).get(task)
    issues = []
    if chosen is None:
        choices = tuple(sorted(context.tasks.newest()))
        message = f"unknown task {task!r}"
        issues.append(ValidationIssue(path="task", message=message, choices=choices))
    issues += [*simulator_issues(context, simulator), *more_issues]
    if issues or chosen is None:
        raise SubmissionError(issues)
    return chosen


def single_job(
    task: Task, config: Mapping[str, Any], track: Track, *, seed: int, owner: str | None
) -> NewJobs:
    """Return one job to be added, without limits and paid for by no sweep.

    Args:
        config: Replaces the model's configuration; boards show its ``name``.
        owner: Id of the API key; None for the operator.
    """
    return NewJobs(
        task=task.name,
        task_version=task.version,
        model_hash=configuration_hash(config, {}),
        track=track.id,
        seeds=[seed],
        model=config["name"],
        model_config=config,
        track_config=track.as_config(),
        owner=owner,
        traceparent=current_traceparent(),
    )


def submit_machine(
    context: Context,
    lease: Lease,
    machine: Machine,
    transcript: Transcript | None,
    *,
    connection: Connection,
    seed: int | None = None,
) -> str | None:
    """Check a machine, and send it to the simulator or score it as a failure.

    Args:
        lease: The lease on its job, which ends here.
        connection: The transaction that holds the lease.
        seed: Seed of the world in which it is tried; None for the exact one.

    Returns:
        The queue to announce it in once the transaction is done; None when the job has ended.
    """
    job = lease.job
    stored = context.artifacts.put(machine_bytes(machine), JSON)
    stored_files = {"machine": stored}
    if transcript is not None:
        stored_files["transcript"] = context.artifacts.put(transcript.to_json(spaced=True), JSON)
    context.store.results.attach(job.id, stored_files, connection=connection)
    refusals = {} if transcript is None else transcript.refusals
    task = task_of(job, context.tasks)
    broken = broken_constraint(task, machine)
    if broken is not None:
        reason, detail = broken
        score = failure_score(
            job, task, machine, outcome=Outcome.CONSTRUCTION_FAILED, reason=reason, detail=detail
        )
        context.store.results.finish(lease, score, connection=connection, refusals=refusals)
        return None
    engine = str(job.track_config["simulator"])
    number = len(context.store.rollouts.read(job.id))
    request = RolloutRequest(
        number=number, final=True, engine=engine, machine_hash=stored.hash, seed=seed
    )
    context.store.rollouts.request(job.id, request, connection=connection)
    queue = simulate_queue(engine)
    context.store.leases.requeue(
        lease, stage=Stage.SIMULATE, queue=queue, connection=connection, refusals=refusals
    )
    return queue


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
    """Open a job that puts a machine through a task's trial, in the world of the seed.

    The exact world, in which ranked machines are tried, is not for practice. The game has no other.

    An equal machine on the same task, simulator and seed gives the same job to every caller; each
    gets a claim on it, and it continues until no claim is left.

    Args:
        machine: The machine; its origin does not matter.
        owner: Id of the API key; None for the operator.

    Returns:
        The job, and whether it is new.

    Raises:
        SubmissionError: The task or the simulator is unknown.
        RefusedError: The owner has as many under way as one may have.
    """
    chosen = resolve_task(context, task, simulator)
    digest = sha256(machine_bytes(machine)).hexdigest()
    config = {
        "name": f"file/{digest[:NAME_LENGTH]}",
        "provider": FILE_PROVIDER,
        "model": digest,
    }
    track = Track(
        workflow=FILE_WORKFLOW,
        simulator=simulator,
        simulation_version=simulation_version(context, simulator),
        prompts="none",
        prompts_digest="00000000",
    )
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
            world = None if simulator == BESIEGE else seed
            queue = submit_machine(context, lease, machine, None, connection=connection, seed=world)
    if queue is not None:
        context.queues.wake(queue)
    return context.store.jobs.get(job_id), fresh
