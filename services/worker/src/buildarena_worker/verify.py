"""Verification: a finished job is replayed without a model, re-simulated, and compared.

Everything that a score rests on is made again: the session from its journal, the machine it
built, the trajectory of each rollout, and the score; figures are compared exactly. The stored bytes
of every artifact are read and hashed.

A figure that comes out different refutes the job, if it came of the same versions of everything.
What can't be made again here, because a version differs or something is missing or damaged, makes
the verification inconclusive: nothing follows from it.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import suppress
from hashlib import sha256
from typing import Any, cast

from buildarena_backend.agents.workbench import bench_of, repeated
from buildarena_backend.artifacts.storing import ArtifactStore
from buildarena_backend.catalog.prompt_packs import PromptPacks
from buildarena_backend.catalog.tasks import TaskCatalog
from buildarena_backend.catalog.tracks import (
    EXTERNAL_WORKFLOW,
    FILE_WORKFLOW,
    has_data_sheets,
    worlds_of,
)
from buildarena_backend.errors import (
    ArtifactDamagedError,
    ArtifactMissingError,
    ArtifactStoreError,
    PermanentError,
)
from buildarena_backend.jobs.job import Job
from buildarena_backend.journal.external_calls import ExternalCall
from buildarena_backend.journal.rollouts import RolloutRecord
from buildarena_backend.results.results import JobScore
from buildarena_backend.states import JobState, Outcome
from buildarena_backend.store import Store
from buildarena_backend.trials.scoring import (
    best_rollout,
    has_counted,
    rollout_score,
    task_of,
    varied_rollouts,
)
from buildarena_backend.trials.simulator import BESIEGE
from buildarena_benchmark import Score, Task, broken_constraint, failed_score, score
from buildarena_besiege import (
    LogIncompleteError,
    MachineNotPlayableError,
    logged_trajectory,
    prepare_run,
)
from buildarena_geometry import KeyPress, Machine
from buildarena_geometry.machine_files import machine_bytes
from buildarena_simulation import (
    SIMULATION_VERSION,
    ControllerFailed,
    MachineNotSimulable,
    Trajectory,
    TrajectoryFormatError,
    UnknownEngineError,
    engine_version,
    read_trajectory,
    schema_of,
    write_trajectory,
)
from buildarena_worker.game_trials import annotations_again
from buildarena_worker.jobs import loop_of, pack_of
from buildarena_worker.processors import (
    Repeated,
    difference,
    named_processor,
    repeating_processor,
    repetitions,
)
from buildarena_worker.session.host import ReplayHost
from buildarena_worker.session.results import (
    Failed,
    Finished,
    LimitReached,
    SessionResult,
    Suspended,
)
from buildarena_worker.session.session import Session
from buildarena_worker.verification_report import (
    SCORED,
    Check,
    Report,
    broken_off,
    compare,
    failure_checks,
    plain,
    score_checks,
    usage_checks,
)
from buildarena_worker.workflow import Workflows
from buildarena_worker.workflow.rounds import run_session


class Verifier:
    """Verifies jobs.

    Args:
        store: Where jobs, journals and rollouts are.
        artifacts: Where kept trajectories are.
        tasks: The tasks.
        packs: The prompts.
        workflows: The ways to build.
    """

    def __init__(
        self,
        *,
        store: Store,
        artifacts: ArtifactStore,
        tasks: TaskCatalog,
        packs: PromptPacks,
        workflows: Workflows,
    ) -> None:
        self._store = store
        self._artifacts = artifacts
        self._tasks = tasks
        self._packs = packs
        self._workflows = workflows

    def verify(self, job_id: str) -> Report:
        """Verifies a job that was scored."""
        job = self._store.jobs.get(job_id)
        try:
            repeated = self._checks(job)
        except (ArtifactMissingError, ArtifactDamagedError) as error:
            repeated = [broken_off(str(error))]
        return Report([*self._artifact_checks(job), *repeated])

    def _artifact_checks(self, job: Job) -> list[Check]:
        """Whether the bytes of every artifact are those that were stored."""
        named = {file.name: file.hash for file in self._store.jobs.files(job.id)}
        for record in self._store.rollouts.read(job.id):
            named[f"machine of rollout {record.number}"] = record.machine_hash
            if record.trajectory_hash is not None:
                named[f"trajectory-{record.number}"] = record.trajectory_hash
        states = {digest: self._state_of(digest) for digest in set(named.values())}
        return [
            compare(f"artifact {name}", digest, states[digest], able=False)
            for name, digest in sorted(named.items())
        ]

    def _state_of(self, digest: str) -> str:
        """The hash of an artifact's bytes, or what is wrong with it."""
        try:
            return _hash(self._artifacts.get(digest))
        except ArtifactMissingError:
            return "missing"
        except ArtifactDamagedError:
            return "damaged"

    def _checks(self, job: Job) -> list[Check]:
        if job.state != JobState.DONE or job.success is None:
            return [compare("scored", kept=True, found=False)]
        if job.track_config["workflow"] in {EXTERNAL_WORKFLOW, FILE_WORKFLOW}:
            return self._external_checks(job)
        try:
            session, host, result = self._replay(job)
        except PermanentError as error:
            return [broken_off(str(error))]
        match result:
            case Finished():
                reasons = []
            case Failed(reason=reason) | LimitReached(limit=reason):
                reasons = [compare("reason", job.reason, reason)]
            case Suspended(number=number):
                return [broken_off(f"waits for rollout {number}")]
            case _:
                return [broken_off(getattr(result, "detail", str(result)))]
        records = self._store.rollouts.read(job.id)
        exact = [record for record in records if record.seed is None]
        checks = [
            compare(
                "transcript", self._artifact(job, "transcript"), _hash(session.transcript.to_json())
            ),
            compare("rollouts", len(exact), len(host.simulated)),
            *usage_checks(job, host.usage),
            *reasons,
        ]
        best = best_rollout(exact, session.task) if has_counted(exact, session.task) else None
        varied: list[Check] = []
        for record, (machine, controls) in zip(exact, host.simulated, strict=False):
            checks += self._rollout_checks(job, record, machine, controls)
            if record is best:
                varied = self._world_checks(job, records, machine, controls)
        checks += varied
        checks += self._score_checks(job, session.machine, records)
        return checks

    def _external_checks(self, job: Job) -> list[Check]:
        """What came about elsewhere: the calls are made again, or the machine is read again."""
        workflow, stored = job.track_config["workflow"], self._artifact(job, "machine")
        if workflow == FILE_WORKFLOW:
            # A file's job is named after the machine; the keys that a person held are part of it.
            named = str(job.model_config.get("model") if workflow == FILE_WORKFLOW else stored)
            machine = Machine.from_document(json.loads(self._artifacts.get(named)))
            return [compare("machine", stored, named), *self._trial_checks(job, machine)]
        with self._store.database.transaction() as connection:
            calls = self._store.external_calls.read(job.id, connection=connection)
        bench = bench_of(task_of(job, self._tasks), data_sheets=has_data_sheets(job.track_config))
        made, tested = repeated(calls, bench)
        checks = [compare("calls", _feedback_of(calls), _feedback_of(made))]
        _, chosen = bench.result() or ("", None)
        return checks + self._trial_checks(job, chosen, tested)

    def _trial_checks(
        self, job: Job, machine: Machine | None, tested: Sequence[Machine] = ()
    ) -> list[Check]:
        """What came of a machine, and of those in the test trials before."""
        checks = []
        task, records = task_of(job, self._tasks), self._store.rollouts.read(job.id)
        if machine is not None:
            if job.outcome != Outcome.LIMIT:
                broken = broken_constraint(task, machine)
                kept = None if has_counted(records, task) else job.reason
                checks.append(compare("reason", kept, None if broken is None else broken[0]))
            exact = [record for record in records if record.seed is None]
            tests = [record for record in exact if not record.final]
            checks.append(compare("test trials", len(tests), len(tested)))
            for record, tried in zip(exact, [*tested, machine], strict=False):
                checks += self._rollout_checks(job, record, tried, None)
            if has_counted(records, task):
                checks += self._world_checks(job, records, machine, None)
        return checks + self._score_checks(job, machine, records)

    def _world_checks(
        self,
        job: Job,
        records: Sequence[RolloutRecord],
        machine: Machine,
        controls: Sequence[KeyPress] | None,
    ) -> list[Check]:
        """Whether the best machine was tried in as many varied worlds as the track says."""
        varied = varied_rollouts(records)
        tried = best_rollout(records, task_of(job, self._tasks)).trajectory_hash is not None
        worlds = worlds_of(job.track_config) if tried else 0
        checks = [compare("worlds", len({record.seed for record in varied}), worlds)]
        for record in varied:
            checks += self._rollout_checks(job, record, machine, controls)
        return checks

    def _replay(self, job: Job) -> tuple[Session, ReplayHost, SessionResult]:
        host = ReplayHost(
            entries=self._store.journal.read(job.id),
            rollouts=self._store.rollouts.read(job.id),
            limits=job.limits,
            load_trajectory=lambda digest: read_trajectory(self._artifacts.get(digest)),
        )
        session = Session(
            task=task_of(job, self._tasks),
            seed=job.seed,
            model_config=job.model_config,
            pack=pack_of(job, self._packs),
            host=host,
            data_sheets=has_data_sheets(job.track_config),
            worlds=worlds_of(job.track_config),
        )
        workflow = self._workflows.find(str(job.track_config["workflow"]))
        return session, host, run_session(session, workflow, loop_of(job))

    def _rollout_checks(
        self,
        job: Job,
        record: RolloutRecord,
        machine: Machine,
        controls: Sequence[KeyPress] | None,
    ) -> list[Check]:
        name, built = f"rollout {record.number}", _hash(machine_bytes(machine))
        checks = [compare(f"{name}: machine", record.machine_hash, built)]
        # Another machine moves otherwise, whoever simulates it.
        trial = record.number if built == record.machine_hash else None
        task, simulated = task_of(job, self._tasks), cast("Repeated | None", None)
        failure = ""
        try:
            if record.engine == BESIEGE:
                checks += [
                    compare(f"{name}: what {engine} says", kept, plain(found))
                    for engine, kept, found in annotations_again(record, task, machine, controls)
                ]
                trajectory = self._played(job, record, machine, task)
            else:
                checks += self._version_checks(name, record)
                simulated = self._repeated(record, machine, task, controls)
                trajectory = simulated.trajectory
        except (MachineNotSimulable, MachineNotPlayableError) as error:
            repeated, digest = failed_score(task, machine), None
            failure = str(error) if isinstance(error, ControllerFailed) else ""
        except LogIncompleteError as error:
            return [*checks, compare(f"{name}: log", "", str(error), able=False)]
        except UnknownEngineError as error:
            return [*checks, compare(f"{name}: engine", record.engine, str(error), able=False)]
        else:
            repeated = score(task, machine, trajectory)
            digest = _hash(self._written_as(record.trajectory_hash, trajectory))
        moved = compare(f"{name}: trajectory", record.trajectory_hash, digest, trial=trial)
        outcomes = [moved, *failure_checks(name, record.versions or {}, failure, trial)]
        checks += outcomes
        repeats = record.engine != BESIEGE and (simulated is not None or failure)
        if repeats and not all(check.ok for check in outcomes):
            checks += self._processor_checks(name, record, simulated)
        for field in SCORED:
            kept = plain(getattr(record, field))
            checks.append(compare(f"{name}: {field}", kept, plain(getattr(repeated, field))))
        return checks

    def _version_checks(self, name: str, record: RolloutRecord) -> list[Check]:
        """Whether a trajectory came of the versions that simulate here."""
        said = record.versions or {}
        here = {"simulation": SIMULATION_VERSION, "engine_version": engine_version(record.engine)}
        return [
            compare(f"{name}: {what.replace('_', ' ')}", said.get(what), version, able=False)
            for what, version in here.items()
        ]

    def _written_as(self, kept: str | None, trajectory: Trajectory) -> bytes:
        """A trajectory's file in the schema of the kept one, which an older version may have."""
        with suppress(ArtifactStoreError, TrajectoryFormatError, ValueError):
            if kept is not None:
                schema = schema_of(self._artifacts.get(kept))
                return write_trajectory(trajectory, schema=schema)
        return write_trajectory(trajectory)

    def _repeated(
        self,
        record: RolloutRecord,
        machine: Machine,
        task: Task,
        controls: Sequence[KeyPress] | None,
    ) -> Repeated:
        """The trial again: the first repetition of equal bytes, or the first."""
        first = None
        for each in repetitions(record, machine, task, controls=controls):
            first = first or each
            written = self._written_as(record.trajectory_hash, each.trajectory)
            if _hash(written) == record.trajectory_hash:
                return each
        assert first is not None  # noqa: S101 - there is one at least
        return first

    def _processor_checks(
        self, name: str, record: RolloutRecord, repeated: Repeated | None
    ) -> list[Check]:
        """Whether another processor may be why bytes differ, so that nothing can be said here."""
        then = named_processor(record.versions or {})
        here = repeating_processor(record) if repeated is None else repeated.processor
        # A runner that names no processor gains nothing by it.
        if then == here or (then is None and record.runner is not None):
            return []
        kept = None
        with suppress(ArtifactStoreError, TrajectoryFormatError, ValueError):
            if record.trajectory_hash is not None:
                kept = read_trajectory(self._artifacts.get(record.trajectory_hash))
        told = dict(here) if repeated is None else difference(kept, repeated)
        return [compare(f"{name}: processor", then and dict(then), told, able=False)]

    def _played(self, job: Job, record: RolloutRecord, machine: Machine, task: Task) -> Trajectory:
        """What the kept log of a trial in the game tells; the game itself plays nothing again.

        Raises:
            LogIncompleteError: There is no log, or it does not tell enough.
            MachineNotPlayableError: The game takes no such machine, so there is no log.
        """
        digest = self._artifact(job, f"log-{record.number}.txt")
        if digest is None:
            prepare_run(machine, task.scenario, name="again", run_id="again")
            raise LogIncompleteError("the log of the trial was not kept")
        text = self._artifacts.get(digest).decode("utf-8", "replace")
        return logged_trajectory(text, record.versions or {}, machine, task.scenario)

    def _score_checks(
        self, job: Job, machine: Machine | None, records: Sequence[RolloutRecord]
    ) -> list[Check]:
        task = task_of(job, self._tasks)
        counted: JobScore | Score = failed_score(task, machine)
        if has_counted(records, task):
            counted = rollout_score(job, task, records)
        return score_checks(job, counted)

    def _artifact(self, job: Job, name: str) -> str | None:
        return self._store.jobs.artifacts(job.id).get(name)


def _feedback_of(calls: Sequence[ExternalCall]) -> list[list[Any]]:
    return [[call.ok, call.reason, call.feedback] for call in calls]


def _hash(data: bytes) -> str:
    return sha256(data).hexdigest()
