"""Varied worlds: a finished machine is tried again in worlds that no model can know of.

Each differs from the exact one within what a fair repetition would vary (place, yaw, cargo, timing
of keys). Their seeds are drawn when the machine is finished, so no builder can prepare for them,
and are stored with their trials, so they can be repeated.
"""

from __future__ import annotations

from collections.abc import Sequence
from random import SystemRandom
from typing import Any, Final

from sqlalchemy import Connection

from buildarena_backend.catalog.tracks import worlds_of
from buildarena_backend.jobs.job import Job
from buildarena_backend.journal.rollouts import RolloutRecord, RolloutRequest
from buildarena_backend.leases.leases import Lease
from buildarena_backend.states import Stage, simulate_queue
from buildarena_backend.store import Store
from buildarena_backend.trials.scoring import best_rollout, rollout_score, varied_rollouts
from buildarena_backend.trials.simulator import BESIEGE
from buildarena_benchmark import Task

SEEDS: Final = 2**31
"""Seeds of worlds are below."""


def finish_or_vary(
    store: Store,
    lease: Lease,
    records: Sequence[RolloutRecord],
    *,
    task: Task,
    connection: Connection,
    **values: Any,
) -> str | None:
    """End a job whose machine was tried, or first request trials in its track's varied worlds.

    Args:
        lease: The lease under which the last trial was done; it ends.
        records: All rollouts of the job, as they are now.
        task: The job's task, see `sample_task`.
        values: Further columns of the job.

    Returns:
        The queue in which the job waits for its next trial; None when it has ended.

    Raises:
        StaleLeaseError: The lease is over; the transaction must be undone.
    """
    best = best_rollout(records, task)
    varied = varied_rollouts(records)
    # A machine that an engine refuses in the exact world is refused in all.
    worlds = worlds_of(lease.job.track_config) if best.trajectory_hash else 0
    if len(varied) < worlds:
        _request(store, lease.job.id, best, len(records), worlds, connection=connection)
    elif all(record.finished_at for record in varied):
        score = rollout_score(lease.job, task, records)
        store.results.finish(lease, score, connection=connection, **values)
        return None
    queue = simulate_queue(best.engine)
    store.leases.requeue(lease, stage=Stage.SIMULATE, queue=queue, connection=connection, **values)
    return queue


def test_seed(job: Job, task: Task, number: int) -> int | None:
    """Return the seed of a test trial's world; None for the exact one, the game's only one.

    Args:
        number: Place among the job's rollouts, from 0.
    """
    if job.track_config["simulator"] == BESIEGE:
        return None
    return task.test_seed(number + 1, job.seed)


def _request(
    store: Store,
    job_id: str,
    best: RolloutRecord,
    first: int,
    worlds: int,
    *,
    connection: Connection,
) -> None:
    """Request trials of the best machine, each in a different world."""
    for number, seed in enumerate(SystemRandom().sample(range(SEEDS), worlds), first):
        request = RolloutRequest(
            number=number,
            final=True,
            engine=best.engine,
            machine_hash=best.machine_hash,
            controls=best.controls,
            seed=seed,
        )
        store.rollouts.request(job_id, request, connection=connection)
