"""The simulate stage: runs a job's waiting rollout, keeps its trajectory, and moves the job on."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from buildarena_benchmark import Score, Task, failed_score, score
from buildarena_geometry import KeyPress, Machine
from buildarena_pipeline.catalog.tasks import TaskCatalog
from buildarena_pipeline.errors import PermanentError, TransientError
from buildarena_pipeline.runtime.active_lease import ActiveLease
from buildarena_pipeline.runtime.context import Context
from buildarena_pipeline.runtime.notify import Notifier
from buildarena_pipeline.runtime.scoring import best_rollout, rollout_score, task_of
from buildarena_simulation import (
    SIMULATION_VERSION,
    MachineNotSimulable,
    SimulationError,
    Trajectory,
    engine_version,
    simulate,
    write_trajectory,
)
from buildarena_store import (
    ArtifactInfo,
    ArtifactStore,
    RolloutRecord,
    Stage,
    StaleLeaseError,
    Store,
)
from buildarena_store.states import CONSTRUCT_QUEUE

PARQUET = "application/vnd.apache.parquet"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Done:
    """A rollout that was simulated, or that could not be because of the machine."""

    score: Score
    trajectory: ArtifactInfo | None
    trace: Sequence[Sequence[float]]
    wall_s: float


class SimulateHandler:
    """Runs rollouts.

    Args:
        store: Where jobs and rollouts are.
        artifacts: Where machines and trajectories are.
        queues: Where construct workers are notified.
        tasks: The tasks.
    """

    def __init__(
        self, *, store: Store, artifacts: ArtifactStore, queues: Notifier, tasks: TaskCatalog
    ) -> None:
        self._store = store
        self._artifacts = artifacts
        self._queues = queues
        self._tasks = tasks

    def __call__(self, active: ActiveLease) -> None:
        """Simulates the job's waiting rollout; the job ends, or goes back to its session."""
        store, lease = self._store, active.lease
        job = lease.job
        records = store.rollouts.read(job.id)
        waiting = [record for record in records if record.finished_at is None]
        if not waiting:
            raise PermanentError("no rollout waits", reason="no_rollout")
        request = waiting[0]
        same = _same_trial(request, records)
        if same is not None:
            values = {name: getattr(same, name) for name in MADE} | {"wall_s": 0.0}
            trajectory = None
        else:
            task = task_of(job, self._tasks)
            done = self._simulate(task, request, lambda: _require(active))
            values, trajectory = _values(request, done), done.trajectory
        with store.database.transaction() as connection:
            if trajectory is not None:
                made = {f"trajectory-{request.number}": trajectory}
                store.results.attach(job.id, made, connection=connection)
            completed = store.rollouts.complete(
                job.id, request.number, connection=connection, **values
            )
            if request.final:
                final = rollout_score(job, best_rollout([*records, completed]))
                store.results.finish(lease, final, connection=connection)
            else:
                store.leases.queue_again(
                    lease, stage=Stage.CONSTRUCT, queue=CONSTRUCT_QUEUE, connection=connection
                )
        if not request.final:
            self._queues.notify_one(CONSTRUCT_QUEUE, job.id)

    def _simulate(
        self, task: Task, request: RolloutRecord, require_held: Callable[[], None]
    ) -> _Done:
        started = time.perf_counter()
        machine = self._machine(request.machine_hash)
        try:
            trajectory = simulate(
                machine,
                task.scenario,
                engine=request.engine,
                controls=_controls(request.controls),
                on_progress=lambda _: require_held(),
            )
        except MachineNotSimulable:
            return _Done(
                score=failed_score(task, machine),
                trajectory=None,
                trace=(),
                wall_s=time.perf_counter() - started,
            )
        except SimulationError as error:
            raise TransientError(str(error), reason="simulator_fault", delay_s=2.0) from error
        kept = self._artifacts.put(write_trajectory(trajectory), PARQUET)
        return _Done(
            score=score(task, machine, trajectory),
            trajectory=kept,
            trace=_trace(trajectory),
            wall_s=time.perf_counter() - started,
        )

    def _machine(self, digest: str) -> Machine:
        document: dict[str, Any] = json.loads(self._artifacts.get(digest))
        return Machine.from_document(document)


def simulate_handler(context: Context) -> SimulateHandler:
    """What does the simulate stage, from a process' connections."""
    return SimulateHandler(
        store=context.store,
        artifacts=context.artifacts,
        queues=context.queues,
        tasks=context.tasks,
    )


MADE = (
    "success",
    "indicator",
    "metrics",
    "flags",
    "trajectory_hash",
    "trace",
    "versions",
)
"""What a simulation adds to a rollout's row."""


def _same_trial(request: RolloutRecord, records: Sequence[RolloutRecord]) -> RolloutRecord | None:
    """An earlier rollout with the same input: the same input gives the same bytes."""
    for record in records:
        done = record.finished_at is not None and record.engine == request.engine
        if done and (record.machine_hash, record.controls) == (
            request.machine_hash,
            request.controls,
        ):
            return record
    return None


def _values(request: RolloutRecord, done: _Done) -> dict[str, Any]:
    return {
        "success": done.score.success,
        "indicator": done.score.indicator,
        "metrics": dict(done.score.metrics),
        "flags": list(done.score.flags),
        "trajectory_hash": None if done.trajectory is None else done.trajectory.hash,
        "trace": [list(row) for row in done.trace],
        "versions": {
            "simulation": SIMULATION_VERSION,
            "engine": request.engine,
            "engine_version": engine_version(request.engine),
        },
        "wall_s": done.wall_s,
    }


def _controls(presses: Sequence[Any] | None) -> tuple[KeyPress, ...] | None:
    return None if presses is None else tuple(KeyPress(**press) for press in presses)


def _require(active: ActiveLease) -> None:
    if active.lost:
        raise StaleLeaseError(active.lease.job.id, active.lease.token)


def _trace(trajectory: Trajectory) -> list[list[float]]:
    """The tracked body at 1 Hz: the cargo where there is one, otherwise the first block."""
    times = trajectory.time_s
    track = trajectory.cargo_position
    if track is None:
        track = trajectory.positions[:, 0]
    rows = []
    last = -1
    for time_s, point in zip(times, track, strict=True):
        if int(time_s + 1e-9) > last:
            last = int(time_s + 1e-9)
            rows.append([round(float(value), 3) for value in (time_s, *point)])
    return rows
