"""Verification: a finished job is replayed without a model, re-simulated, and compared.

Everything that a score rests on is made again: the session from its journal, the machine it
built, the trajectory of each rollout, and the score; figures are compared exactly.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from hashlib import sha256
from typing import Any

import structlog

from buildarena_benchmark import failed_score, score
from buildarena_geometry import KeyPress, Machine
from buildarena_pipeline.agents.workbench import Workbench
from buildarena_pipeline.catalog.prompt_packs import PromptPacks
from buildarena_pipeline.catalog.tracks import EXTERNAL_WORKFLOW
from buildarena_pipeline.errors import PermanentError
from buildarena_pipeline.runtime.context import Context
from buildarena_pipeline.runtime.machine_documents import machine_bytes
from buildarena_pipeline.runtime.scoring import best_rollout, task_of
from buildarena_simulation import (
    SIMULATION_VERSION,
    MachineNotSimulable,
    read_trajectory,
    simulate,
    write_trajectory,
)
from buildarena_store import ExternalCall, Job, RolloutRecord, Usage
from buildarena_worker.construct import loop_of, pack_of
from buildarena_worker.errors import (
    ConstructionFailedError,
    JournalMismatchError,
    LimitReachedError,
)
from buildarena_worker.session.host import SessionIO, SuspendedError
from buildarena_worker.session.session import Session
from buildarena_worker.workflow import Workflows
from buildarena_worker.workflow.rounds import run_session


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """One comparison: what is kept, and what came out now."""

    name: str
    ok: bool
    kept: Any
    found: Any


class _ReplayIO(SessionIO):
    """Gives kept answers only, and notes which machines were to be simulated."""

    machines: list[tuple[Machine, Sequence[KeyPress] | None]]

    def simulate(
        self, machine: Machine, controls: Sequence[KeyPress] | None, *, final: bool
    ) -> RolloutRecord:
        # A copy: what an analyst looks up in the machine later is added to its log.
        self.machines.append((machine.copy(), controls))
        return super().simulate(machine, controls, final=final)


log = structlog.get_logger(__name__)


class Verifier:
    """Verifies jobs.

    Args:
        context: The process' connections.
    """

    def __init__(self, context: Context) -> None:
        self._context = context
        self._packs = PromptPacks(context.settings.prompt_packs)
        self._workflows = Workflows(context.settings.workflows)

    def verify(self, job_id: str) -> dict[str, Any]:
        """Verifies a job that was scored.

        Returns:
            ``{"ok", "checks": [{"name", "ok", "kept", "found"}]}``.
        """
        job = self._context.store.jobs.get(job_id)
        checks = self._checks(job)
        return {"ok": all(check.ok for check in checks), "checks": [asdict(c) for c in checks]}

    def _checks(self, job: Job) -> list[Check]:
        if job.state != "done" or job.success is None:
            return [_compare("scored", kept=True, found=False)]
        if job.track_config["workflow"] == EXTERNAL_WORKFLOW:
            return self._external_checks(job)
        try:
            session, io, failure = self._replay(job)
        except (JournalMismatchError, PermanentError, SuspendedError) as error:
            return [Check(name="replay", ok=False, kept="the journal", found=str(error))]
        records = self._context.store.rollouts.read(job.id)
        checks = [
            _compare(
                "transcript", self._artifact(job, "transcript"), _hash(session.transcript.to_json())
            ),
            _compare("rollouts", len(records), len(io.machines)),
            *_usage_checks(job, io.spent.usage),
        ]
        if isinstance(failure, ConstructionFailedError):
            checks.append(_compare("reason", job.reason, failure.reason))
        if isinstance(failure, LimitReachedError):
            checks.append(_compare("reason", job.reason, failure.limit))
        for record, (machine, controls) in zip(records, io.machines, strict=False):
            checks += self._rollout_checks(job, record, machine, controls)
        checks += self._score_checks(job, session.machine, records)
        return checks

    def _external_checks(self, job: Job) -> list[Check]:
        """An outside agent's calls are made again; what it thought in between is its own."""
        with self._context.store.database.transaction() as connection:
            calls = self._context.store.external_calls.read(job.id, connection=connection)
        bench = Workbench()
        again = [bench.call(call.machine, call.tool, call.arguments) for call in calls]
        checks = [_compare("calls", [_said(call) for call in calls], [_said(c) for c in again])]
        chosen = bench.result()
        machine = None if chosen is None else chosen[1]
        records = self._context.store.rollouts.read(job.id)
        if machine is not None:
            for record in records:
                checks += self._rollout_checks(job, record, machine, None)
        return checks + self._score_checks(job, machine, records)

    def _replay(self, job: Job) -> tuple[Session, _ReplayIO, Exception | None]:
        io = _ReplayIO(
            client=None,
            entries=self._context.store.journal.read(job.id),
            rollouts=self._context.store.rollouts.read(job.id),
            append=lambda _: None,
            still_held=lambda: True,
            limits=job.limits,
            load_trajectory=lambda digest: read_trajectory(self._context.artifacts.get(digest)),
        )
        io.machines = []
        session = Session(
            task=task_of(job, self._context.tasks),
            seed=job.seed,
            model_config=job.model_config,
            pack=pack_of(job, self._packs),
            io=io,
        )
        workflow = self._workflows.find(str(job.track_config["workflow"]))
        try:
            run_session(session, workflow, loop_of(job))
        except (ConstructionFailedError, LimitReachedError) as failure:
            return session, io, failure
        return session, io, None

    def _rollout_checks(
        self,
        job: Job,
        record: RolloutRecord,
        machine: Machine,
        controls: Sequence[KeyPress] | None,
    ) -> list[Check]:
        name = f"rollout {record.number}"
        checks = [_compare(f"{name}: machine", record.machine_hash, _hash(machine_bytes(machine)))]
        simulated_by = (record.versions or {}).get("simulation")
        checks.append(_compare(f"{name}: simulation version", simulated_by, SIMULATION_VERSION))
        task = task_of(job, self._context.tasks)
        try:
            trajectory = simulate(
                machine,
                task.scenario,
                record.engine,
                controls=None if controls is None else tuple(controls),
            )
        except MachineNotSimulable:
            again, digest = failed_score(task, machine), None
        else:
            again, digest = score(task, machine, trajectory), _hash(write_trajectory(trajectory))
        checks.append(_compare(f"{name}: trajectory", record.trajectory_hash, digest))
        for field in ("success", "indicator", "metrics", "flags"):
            kept = _plain(getattr(record, field))
            checks.append(_compare(f"{name}: {field}", kept, _plain(getattr(again, field))))
        return checks

    def _score_checks(
        self, job: Job, machine: Machine | None, records: Sequence[RolloutRecord]
    ) -> list[Check]:
        if any(record.finished_at for record in records):
            best = best_rollout(records)
            wanted = {name: _plain(getattr(best, name)) for name in SCORED}
        else:
            failed = failed_score(task_of(job, self._context.tasks), machine)
            wanted = {name: _plain(getattr(failed, name)) for name in SCORED}
        return [_compare(f"score: {n}", _plain(getattr(job, n)), v) for n, v in wanted.items()]

    def _artifact(self, job: Job, name: str) -> str | None:
        return self._context.store.jobs.artifacts(job.id).get(name)


class VerificationRunner:
    """Does the verifications that messages speak of.

    Args:
        context: The process' connections.
    """

    def __init__(self, context: Context) -> None:
        self._context = context
        self._verifier = Verifier(context)

    def process(self, verification_id: str) -> None:
        """Does a verification, unless another worker has it."""
        claimed = self._context.store.verifications.claim(verification_id)
        if claimed is None:
            return
        try:
            report = self._verifier.verify(claimed.job_id)
        except Exception as error:
            log.exception("verification_failed", job=claimed.job_id)
            failed = Check(name="verification", ok=False, kept=None, found=f"it broke off: {error}")
            report = {"ok": False, "checks": [asdict(failed)]}
        self._context.store.verifications.finish(verification_id, report)


SCORED = ("success", "indicator", "metrics", "flags")
COUNTED = ("requests", "input_tokens", "output_tokens", "cached_tokens", "reasoning_tokens")


def _said(call: ExternalCall) -> list[Any]:
    return [call.ok, call.reason, call.feedback]


def _usage_checks(job: Job, usage: Usage) -> list[Check]:
    checks = [_compare(f"usage: {n}", getattr(job, n), getattr(usage, n)) for n in COUNTED]
    checks.append(_compare("usage: cost_usd", f"{job.cost_usd:f}", f"{usage.cost_usd:.6f}"))
    return checks


def _compare(name: str, kept: Any, found: Any) -> Check:
    return Check(name=name, ok=kept == found, kept=kept, found=found)


def _hash(data: bytes) -> str:
    return sha256(data).hexdigest()


def _plain(value: Any) -> Any:
    """A value as it comes back from JSON."""
    if isinstance(value, Mapping):
        value = dict(value)
    elif isinstance(value, tuple):
        value = list(value)
    return json.loads(json.dumps(value))
