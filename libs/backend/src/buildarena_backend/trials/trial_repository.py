"""The repository of trials: the pending trials of leased jobs, and their scored results.

Workers next to the database and the API's runner routes use the same code, so that a trial's score
does not depend on where it was run.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from random import SystemRandom
from typing import Any

from buildarena_backend.artifacts.store import ArtifactInfo
from buildarena_backend.catalog.tracks import EXTERNAL_WORKFLOW
from buildarena_backend.errors import PermanentError
from buildarena_backend.jobs.job import Job
from buildarena_backend.journal.rollouts import RolloutRecord
from buildarena_backend.leases.leases import Lease
from buildarena_backend.process.context import Context
from buildarena_backend.results.audits import is_unproved, runner_key
from buildarena_backend.states import CONSTRUCT_QUEUE, EXTERNAL_QUEUE, Stage
from buildarena_backend.trials.known_simulators import configured_simulators
from buildarena_backend.trials.scoring import task_of
from buildarena_backend.trials.trials import PARQUET, File, TrialResult
from buildarena_backend.trials.worlds import finish_or_vary
from buildarena_benchmark import Score, Task, failed_score, score
from buildarena_geometry import KeyPress, Machine
from buildarena_simulation import Trajectory, write_trajectory

INPUT = ("engine", "machine_hash", "controls", "seed")
RESULT = (
    *("success", "indicator", "metrics", "flags", "trajectory_hash"),
    *("trace", "versions", "annotations", "runner", "audited"),
)
"""Inputs of a simulation, and what it adds to a rollout."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DueTrial:
    """A trial that a job waits for.

    Attributes:
        request: The requested rollout.
        records: All rollouts of the job.
    """

    job: Job
    task: Task
    machine: Machine
    request: RolloutRecord
    records: Sequence[RolloutRecord]

    @property
    def controls(self) -> tuple[KeyPress, ...] | None:
        """Key presses of this trial; None for the machine's own."""
        presses = self.request.controls
        return None if presses is None else tuple(KeyPress(**press) for press in presses)

    @property
    def version(self) -> str:
        """The simulator's version that the job was submitted for."""
        return str(self.job.track_config["simulation_version"])


class TrialRepository:
    """Finds pending trials, and writes their results.

    Args:
        context: Connections, tasks, and the share of the trials by runners that is verified before
            it counts, on simulators whose trials a verification can repeat.
    """

    def __init__(self, context: Context) -> None:
        self._store = context.store
        self._artifacts = context.artifacts
        self._queues = context.queues
        self._tasks = context.tasks
        self._verification_rates = {
            name: context.settings.verification_rate
            for name, simulator in configured_simulators(context.settings).items()
            if simulator.deterministic
        }

    def due(self, job: Job) -> DueTrial:
        """Return the trial that a job in the simulate stage waits for.

        Raises:
            PermanentError: It waits for none, or its task was removed.
            ArtifactStoreError: The machine can't be read now.
        """
        records = self._store.rollouts.read(job.id)
        waiting = [record for record in records if record.finished_at is None]
        if not waiting:
            raise PermanentError("the job has no pending trial", reason="no_rollout")
        request = waiting[0]
        document: dict[str, Any] = json.loads(self._artifacts.get(request.machine_hash))
        return DueTrial(
            job=job,
            task=task_of(job, self._tasks),
            machine=Machine.from_document(document),
            request=request,
            records=records,
        )

    def repeat(self, lease: Lease, due: DueTrial) -> bool:
        """Complete a trial with the result of an earlier one of its job that had the same input.

        Only of engines whose trials have the same bytes each time.

        Returns:
            Whether there was one.

        Raises:
            StaleLeaseError: The lease is over; nothing was written.
        """
        if due.request.engine not in self._verification_rates:
            return False
        for record in due.records:
            if record.finished_at is not None and all(
                getattr(record, name) == getattr(due.request, name) for name in INPUT
            ):
                artifacts = {
                    f"trajectory-{due.request.number}": ArtifactInfo(
                        hash=file.sha256, media_type=file.media_type, size=file.size
                    )
                    for file in self._store.jobs.files(lease.job.id)
                    if file.sha256 == record.trajectory_hash
                }
                result = {name: getattr(record, name) for name in RESULT}
                self._write(lease, due, {**result, "wall_s": 0.0}, artifacts)
                return True
        return False

    def complete(self, lease: Lease, due: DueTrial, outcome: TrialResult) -> None:
        """Score a trial and move its job, all or nothing: it ends, or its construction continues.

        Raises:
            StaleLeaseError: The lease is over; nothing was written.
            ArtifactStoreError: The trajectory can't be kept now.
        """
        trajectory, runner = outcome.trajectory, runner_key(lease.owner)
        artifacts: dict[str, ArtifactInfo] = {}
        values: dict[str, Any] = {
            "versions": dict(outcome.versions),
            "wall_s": outcome.wall_s,
            "trajectory_hash": None,
            "trace": [],
            "runner": runner,
            "audited": runner is not None and self._is_audited(runner, due, trajectory),
        }
        if trajectory is None:
            values |= _columns_of(failed_score(due.task, due.machine))
        else:
            values |= _columns_of(score(due.task, due.machine, trajectory))
            info = self._artifacts.put(write_trajectory(trajectory), PARQUET)
            values |= {"trajectory_hash": info.hash, "trace": tracked_at_1_hz(trajectory)}
            artifacts[f"trajectory-{due.request.number}"] = info
        if outcome.annotations is not None:
            values["annotations"] = dict(outcome.annotations)
        self._write(lease, due, values, artifacts | self._put(outcome.files))

    def _is_audited(self, runner: str, due: DueTrial, trajectory: Trajectory | None) -> bool:
        """Return whether a runner's trial is verified before it counts, unpredictably for runners.

        That a program failed is always verified, as nothing else shows it.
        """
        share = self._verification_rates.get(due.request.engine)
        if share is None:
            return False
        if trajectory is None and due.machine.controller and due.controls is None:
            return True
        if SystemRandom().random() < share:
            return True
        with self._store.database.statement() as connection:
            return is_unproved(runner, connection=connection)

    def store_evidence(self, job: Job, files: Mapping[str, File]) -> None:
        """Store evidence of a fault with the job, in place of earlier evidence.

        Raises:
            PermanentError: The job waits for no trial.
        """
        if files:
            stored, number = self._put(files), self.due(job).request.number
            with self._store.database.transaction() as connection:
                self._store.results.replace_evidence(job.id, number, stored, connection=connection)

    def _write(
        self,
        lease: Lease,
        due: DueTrial,
        values: Mapping[str, Any],
        artifacts: Mapping[str, ArtifactInfo],
    ) -> None:
        store, job, request = self._store, due.job, due.request
        with store.database.transaction() as connection:
            if artifacts:
                store.results.attach(job.id, artifacts, connection=connection)
            completed = store.rollouts.complete(
                job.id, request.number, connection=connection, **values
            )
            queue: str | None = CONSTRUCT_QUEUE
            external = job.track_config.get("workflow") == EXTERNAL_WORKFLOW
            if external and not request.final:
                store.leases.requeue(
                    lease, stage=Stage.CONSTRUCT, queue=EXTERNAL_QUEUE, connection=connection
                )
                store.external_calls.go_on(job.id, connection=connection)
                queue = None
            elif request.final:
                records = [completed if r.number == completed.number else r for r in due.records]
                queue = finish_or_vary(store, lease, records, task=due.task, connection=connection)
            else:
                store.leases.requeue(
                    lease, stage=Stage.CONSTRUCT, queue=CONSTRUCT_QUEUE, connection=connection
                )
        if queue is not None:
            self._queues.wake(queue)

    def _put(self, files: Mapping[str, File]) -> dict[str, ArtifactInfo]:
        return {
            name: self._artifacts.put(file.data, file.media_type) for name, file in files.items()
        }


def _columns_of(score: Score) -> dict[str, Any]:
    return {
        "success": score.success,
        "indicator": score.indicator,
        "metrics": dict(score.metrics),
        "flags": list(score.flags),
    }


def tracked_at_1_hz(trajectory: Trajectory) -> list[list[float]]:
    """Return the tracked body at 1 Hz: the cargo where there is one, otherwise the first block."""
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
