"""The simulate stage: runs a job's waiting rollout, keeps its trajectory, and moves the job on."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence
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
from buildarena_simulation import Trajectory, write_trajectory
from buildarena_simworker.simulators.simulator import (
    File,
    MachineRefusedError,
    Simulated,
    Simulator,
    SimulatorFaultError,
    Trial,
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

    values: Mapping[str, Any]
    artifacts: Mapping[str, ArtifactInfo]


class SimulateHandler:
    """Runs rollouts.

    Args:
        store: Where jobs and rollouts are.
        artifacts: Where machines and trajectories are.
        queues: Where construct workers are notified.
        tasks: The tasks.
        simulator: What runs them.
    """

    def __init__(
        self,
        *,
        store: Store,
        artifacts: ArtifactStore,
        queues: Notifier,
        tasks: TaskCatalog,
        simulator: Simulator,
    ) -> None:
        self._store = store
        self._artifacts = artifacts
        self._queues = queues
        self._tasks = tasks
        self._simulator = simulator

    def __call__(self, active: ActiveLease) -> None:
        """Simulates the job's waiting rollout; the job ends, or goes back to its session."""
        store, lease = self._store, active.lease
        job = lease.job
        records = store.rollouts.read(job.id)
        waiting = [record for record in records if record.finished_at is None]
        if not waiting:
            raise PermanentError("no rollout waits", reason="no_rollout")
        request = waiting[0]
        same = _same_trial(request, records) if self._simulator.repeatable else None
        if same is not None:
            values = {name: getattr(same, name) for name in MADE} | {"wall_s": 0.0}
            done = _Done(values=values, artifacts={})
        else:
            done = self._simulated(active, request)
        with store.database.transaction() as connection:
            if done.artifacts:
                store.results.attach(job.id, done.artifacts, connection=connection)
            completed = store.rollouts.complete(
                job.id, request.number, connection=connection, **done.values
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

    def _simulated(self, active: ActiveLease, request: RolloutRecord) -> _Done:
        """Runs the trial and scores it; what shows a fault is kept before it is reported."""
        started = time.perf_counter()
        job = active.lease.job
        task, machine = task_of(job, self._tasks), self._machine(request.machine_hash)
        try:
            simulated = self._simulator.run(
                Trial(
                    job_id=job.id,
                    number=request.number,
                    token=active.lease.token,
                    version=str(job.track_config["simulation_version"]),
                    task=task,
                    machine=machine,
                    controls=_controls(request.controls),
                    require_held=lambda: _require(active),
                )
            )
        except MachineRefusedError:
            values = _scored(failed_score(task, machine)) | {"trajectory_hash": None, "trace": []}
            values["versions"] = dict(self._simulator.versions)
            values["wall_s"] = time.perf_counter() - started
            return _Done(values=values, artifacts={})
        except SimulatorFaultError as fault:
            self._keep_evidence(job.id, fault)
            raise TransientError(
                str(fault),
                reason="simulator_fault",
                delay_s=fault.delay_s,
                endless=fault.endless,
            ) from fault
        return self._kept(request, simulated, task, machine, started)

    def _kept(
        self,
        request: RolloutRecord,
        simulated: Simulated,
        task: Task,
        machine: Machine,
        started: float,
    ) -> _Done:
        trajectory = simulated.trajectory
        kept = self._artifacts.put(write_trajectory(trajectory), PARQUET)
        artifacts = {f"trajectory-{request.number}": kept, **self._put(simulated.files)}
        values = {
            **_scored(score(task, machine, trajectory)),
            "trajectory_hash": kept.hash,
            "trace": _trace(trajectory),
            "versions": dict(simulated.versions),
            "wall_s": time.perf_counter() - started,
        }
        if simulated.annotations is not None:
            values["annotations"] = dict(simulated.annotations)
        return _Done(values=values, artifacts=artifacts)

    def _keep_evidence(self, job_id: str, fault: SimulatorFaultError) -> None:
        if fault.files:
            kept = self._put(fault.files)
            with self._store.database.transaction() as connection:
                self._store.results.attach(job_id, kept, connection=connection)

    def _put(self, files: Mapping[str, File]) -> dict[str, ArtifactInfo]:
        return {
            name: self._artifacts.put(file.data, file.media_type) for name, file in files.items()
        }

    def _machine(self, digest: str) -> Machine:
        document: dict[str, Any] = json.loads(self._artifacts.get(digest))
        return Machine.from_document(document)


def simulate_handler(context: Context, simulator: Simulator) -> SimulateHandler:
    """What does the simulate stage, from a process' connections."""
    return SimulateHandler(
        store=context.store,
        artifacts=context.artifacts,
        queues=context.queues,
        tasks=context.tasks,
        simulator=simulator,
    )


SCORED = ("success", "indicator", "metrics", "flags")
MADE = (*SCORED, "trajectory_hash", "trace", "versions", "annotations")
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


def _scored(found: Score) -> dict[str, Any]:
    return {
        "success": found.success,
        "indicator": found.indicator,
        "metrics": dict(found.metrics),
        "flags": list(found.flags),
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
