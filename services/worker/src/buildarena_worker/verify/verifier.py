"""Comparison of a finished job's stored results with those of a repetition."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from buildarena_backend.agents.workbench import bench_of, repeat_calls
from buildarena_backend.artifacts.store import ArtifactStore
from buildarena_backend.catalog.tracks import (
    EXTERNAL_WORKFLOW,
    FILE_WORKFLOW,
    has_data_sheets,
    session_limits,
    worlds_of,
)
from buildarena_backend.errors import ArtifactDamagedError, ArtifactMissingError, PermanentError
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
from buildarena_benchmark import Score, Task, broken_constraint, failed_score
from buildarena_geometry import Machine
from buildarena_simulation import read_trajectory
from buildarena_worker.session.host import JournalHost, Setup
from buildarena_worker.session.results import Failed, Finished, Suspended
from buildarena_worker.sessions import Sessions
from buildarena_worker.verify.report import Check, Report, broken_off, score_checks, usage_checks
from buildarena_worker.verify.trials import TrialVerifier, digest_of


@dataclass(frozen=True, slots=True, kw_only=True)
class _Stored:
    """Stored records of a job other than its journal: rollouts, and files' hashes by name."""

    job: Job
    records: Sequence[RolloutRecord]
    files: Mapping[str, str]

    @property
    def requested(self) -> list[RolloutRecord]:
        """Rollouts that the session requested: all but those in varied worlds."""
        return [record for record in self.records if not record.is_varied]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Rebuilt:
    """Result of rebuilding: the last machine, all tested machines, and comparisons."""

    machine: Machine | None
    tested: Sequence[Setup]
    checks: Sequence[Check]


@dataclass(frozen=True, slots=True, kw_only=True)
class Verifier:
    """Verifier of finished jobs."""

    store: Store
    artifacts: ArtifactStore
    sessions: Sessions

    def verify(self, job_id: str) -> Report:
        """Verify a job that was scored."""
        stored = _Stored(
            job=self.store.jobs.get(job_id),
            records=self.store.rollouts.read(job_id),
            files=self.store.jobs.artifacts(job_id),
        )
        try:
            repetition_checks = self._repetition_checks(stored)
        except (ArtifactMissingError, ArtifactDamagedError, PermanentError) as error:
            repetition_checks = [broken_off(str(error))]
        return Report([*self._artifact_checks(stored), *repetition_checks])

    def _artifact_checks(self, stored: _Stored) -> list[Check]:
        """Check the bytes of every artifact against their hash."""
        named = dict(stored.files)
        for record in stored.records:
            named[f"machine of rollout {record.number}"] = record.machine_hash
            if record.trajectory_hash is not None:
                named[f"trajectory-{record.number}"] = record.trajectory_hash
        states = {digest: self._state_of(digest) for digest in set(named.values())}
        return [
            Check(f"artifact {name}", digest, states[digest], able=False)
            for name, digest in sorted(named.items())
        ]

    def _state_of(self, digest: str) -> str:
        """Return the hash of an artifact's bytes, "missing" or "damaged"."""
        try:
            return digest_of(self.artifacts.get(digest))
        except ArtifactMissingError:
            return "missing"
        except ArtifactDamagedError:
            return "damaged"

    def _repetition_checks(self, stored: _Stored) -> list[Check]:
        job, workflow = stored.job, stored.job.track_config["workflow"]
        if job.state != JobState.DONE or job.success is None:
            return [Check("scored", stored=True, fresh=False)]
        task = task_of(job, self.sessions.tasks)
        rebuild = {FILE_WORKFLOW: self._from_file, EXTERNAL_WORKFLOW: self._from_calls}
        rebuilt = rebuild.get(workflow, self._from_journal)(stored, task)
        checks = [*rebuilt.checks, *self._trial_checks(stored, task, rebuilt.tested)]
        counted: JobScore | Score = failed_score(task, rebuilt.machine)
        if has_counted(stored.records, task):
            counted = rollout_score(job, task, stored.records)
        return checks + score_checks(job, counted)

    def _from_journal(self, stored: _Stored, _: Task) -> _Rebuilt:
        """Rebuild a session's machines with the stored replies."""
        job = stored.job
        host = JournalHost(
            entries=self.store.journal.read(job.id),
            rollouts=stored.records,
            limits=session_limits(job.track_config, job.limits),
            load_trajectory=lambda digest: read_trajectory(self.artifacts.get(digest)),
        )
        session, result = self.sessions.run(job, host)
        match result:
            case Finished():
                reasons = []
            case Failed(reason=reason):
                reasons = [Check("reason", job.reason, reason)]
            case Suspended(number=number):
                raise PermanentError(f"waits for rollout {number}", reason="not_repeatable")
            case _:
                raise PermanentError(str(result), reason="not_repeatable")
        transcript = digest_of(session.transcript.to_json())
        checks = [
            Check("transcript", stored.files.get("transcript"), transcript),
            Check("rollouts", len(stored.requested), len(host.simulated)),
            *usage_checks(job, host.spending.usage),
            *reasons,
        ]
        return _Rebuilt(machine=session.machine, tested=host.simulated, checks=checks)

    def _from_file(self, stored: _Stored, task: Task) -> _Rebuilt:
        """Rebuild the machine of a file, whose hash is the job's model."""
        named = str(stored.job.model_config.get("model"))
        machine = Machine.from_document(json.loads(self.artifacts.get(named)))
        check = Check("machine", stored.files.get("machine"), named)
        return _check_external(stored, task, check, tests=(), machine=machine)

    def _from_calls(self, stored: _Stored, task: Task) -> _Rebuilt:
        """Rebuild a machine from the stored calls over the API."""
        with self.store.database.transaction() as connection:
            calls = self.store.external_calls.read(stored.job.id, connection=connection)
        bench = bench_of(task, data_sheets=has_data_sheets(stored.job.track_config))
        repeated_calls, tests = repeat_calls(calls, bench)
        check = Check("calls", _feedback_of(calls), _feedback_of(repeated_calls))
        _, machine = bench.result() or ("", None)
        return _check_external(stored, task, check, tests=tests, machine=machine)

    def _trial_checks(self, stored: _Stored, task: Task, machines: Sequence[Setup]) -> list[Check]:
        """Repeat each trial, and check that the best machine was tested in all varied worlds."""
        trials = TrialVerifier(task=task, artifacts=self.artifacts, files=stored.files)
        pairs = list(zip(stored.requested, machines, strict=False))
        checks = [check for pair in pairs for check in trials.checks(*pair)]
        if not has_counted(stored.records, task):
            return checks
        best = best_rollout(stored.records, task)
        varied = varied_rollouts(stored.records)
        worlds = 0 if best.trajectory_hash is None else worlds_of(stored.job.track_config)
        for machine in [machine for record, machine in pairs if record is best]:
            checks.append(Check("worlds", len({record.seed for record in varied}), worlds))
            checks += [check for record in varied for check in trials.checks(record, machine)]
        return checks


def _check_external(
    stored: _Stored, task: Task, check: Check, *, tests: Sequence[Machine], machine: Machine | None
) -> _Rebuilt:
    """Check a machine that was not built by a session against the task's rules."""
    if machine is None:
        return _Rebuilt(machine=None, tested=(), checks=[check])
    checks, job = [check], stored.job
    if job.outcome != Outcome.LIMIT:
        broken = broken_constraint(task, machine)
        reason = None if has_counted(stored.records, task) else job.reason
        checks.append(Check("reason", reason, None if broken is None else broken[0]))
    tested = [record for record in stored.requested if not record.final]
    checks.append(Check("test trials", len(tested), len(tests)))
    machines = [(each, None) for each in (*tests, machine)]
    return _Rebuilt(machine=machine, tested=machines, checks=checks)


def _feedback_of(calls: Sequence[ExternalCall]) -> list[list[object]]:
    return [[call.ok, call.reason, call.feedback] for call in calls]
