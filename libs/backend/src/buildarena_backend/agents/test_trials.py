"""Test trials of external agents: trials of an unfinished machine, whose session continues."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from pydantic import with_config
from sqlalchemy import Connection

from buildarena_backend.errors import RefusedError
from buildarena_backend.journal.rollouts import RolloutRecord, RolloutRequest
from buildarena_backend.leases.leases import Lease
from buildarena_backend.process.context import Context
from buildarena_backend.states import Stage, simulate_queue
from buildarena_backend.trials.worlds import test_seed
from buildarena_benchmark import Task, broken_constraint
from buildarena_benchmark.environment.briefing import describe_tests
from buildarena_benchmark.environment.trials.trials import score_text
from buildarena_geometry import Machine
from buildarena_geometry.machine_files import machine_bytes
from buildarena_simulation import read_trajectory

JSON: Final = "application/json"


def _none(message: str) -> RefusedError:
    return RefusedError("no_test_trial", message)


@with_config(use_attribute_docstrings=True)
@dataclass(frozen=True, slots=True, kw_only=True)
class TestTrial:
    """A test trial: its measurements are reported, and do not count."""

    number: int
    """Its number, from 1."""
    result: str | None
    """Measurements in words; null during the trial."""
    trace: Sequence[Sequence[float]]
    """Position of the tracked body each second: time (s), and x, y, z (units)."""


def describe_submission(task: Task | None) -> str:
    """Return how an agent submits and tests its machine; None for a task without test trials."""
    if task is None or not task.test_trials:
        return "Submit once; the machine has one trial."
    return (
        "`test` tries the current machine and reports the measurements in the session, which "
        f"continues. {describe_tests(task)} Submit once, for the trial that counts."
    )


def request_test(
    context: Context, lease: Lease, task: Task, machine: Machine, *, connection: Connection
) -> tuple[int, str]:
    """Have a session's machine tried.

    Args:
        lease: The agent's lease on its session, which ends here and begins again after the trial.
        task: The job's task, see `sample_task`.
        connection: The transaction that holds the lease.

    Returns:
        Which test trial it is, from 1, and the queue to announce it in once the transaction is
        done.

    Raises:
        RefusedError: None is available; the message has the reason. None is used up.
    """
    used = len(context.store.rollouts.read(lease.job.id))
    if not task.test_trials:
        raise _none(f"task {task.name} has no test trials: submit")
    if used >= task.test_trials:
        raise _none(f"all {task.test_trials} test trials are used up: submit")
    broken = broken_constraint(task, machine)
    if broken is not None:
        raise _none(f"this machine would not be tried: {broken[1]}")
    engine = str(lease.job.track_config["simulator"])
    stored = context.artifacts.put(machine_bytes(machine), JSON)
    request = RolloutRequest(
        number=used,
        final=False,
        engine=engine,
        machine_hash=stored.hash,
        seed=test_seed(lease.job, task, used),
    )
    queue = simulate_queue(engine)
    context.store.results.attach(lease.job.id, {"machine": stored}, connection=connection)
    context.store.rollouts.request(lease.job.id, request, connection=connection)
    context.store.leases.requeue(lease, stage=Stage.SIMULATE, queue=queue, connection=connection)
    return used + 1, queue


def trials_of(context: Context, job_id: str, task: Task) -> list[TestTrial]:
    """Return the test trials of a session, in order, as they are reported."""
    records = context.store.rollouts.read(job_id)
    return [_describe(context, task, record) for record in records if not record.final]


def _describe(context: Context, task: Task, record: RolloutRecord) -> TestTrial:
    if record.finished_at is None:
        return TestTrial(number=record.number + 1, result=None, trace=())
    digest = record.trajectory_hash
    trajectory = None if digest is None else read_trajectory(context.artifacts.get(digest))
    return TestTrial(
        number=record.number + 1,
        result=score_text(task, record.score, trajectory),
        trace=record.trace or (),
    )
