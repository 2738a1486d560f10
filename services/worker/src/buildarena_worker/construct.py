"""The construct stage: runs or resumes a job's session, then advances the job."""

from dataclasses import dataclass
from functools import partial
from typing import assert_never

from msgspec import to_builtins

from buildarena_backend.accounts.budgets import BudgetShortage
from buildarena_backend.artifacts.store import ArtifactInfo, ArtifactStore
from buildarena_backend.catalog.models import ModelRegistry
from buildarena_backend.catalog.prices import price_usd
from buildarena_backend.catalog.tracks import session_limits
from buildarena_backend.journal.rollouts import RolloutRequest
from buildarena_backend.journal.transcript import ModelTurn
from buildarena_backend.journal.turns import TurnResult, Turns
from buildarena_backend.leases.leases import Lease
from buildarena_backend.process.active_lease import ActiveLease
from buildarena_backend.queue.queues import Queues
from buildarena_backend.states import AttemptResult, JobState, Outcome, Stage, simulate_queue
from buildarena_backend.store import Store
from buildarena_backend.trials.scoring import failure_score
from buildarena_backend.trials.worlds import finish_or_vary, test_seed
from buildarena_geometry.machine_files import machine_bytes
from buildarena_simulation import read_trajectory
from buildarena_worker.providers.provider import ModelClients
from buildarena_worker.session import results
from buildarena_worker.session.concurrency_gate import ConcurrencyGate
from buildarena_worker.session.host import JournalHost
from buildarena_worker.session.requester import Requester
from buildarena_worker.session.session import Session
from buildarena_worker.sessions import Sessions

JSON = "application/json"


class TurnKeeper:
    """Store of a job's turns, which writes each once, however often its session is repeated."""

    def __init__(self, turns: Turns, lease: Lease, gate: ConcurrencyGate) -> None:
        self._turns = turns
        self._gate = gate
        self._lease = lease
        self._stored = 0 if lease.first else turns.count(lease.job.id)

    def __call__(self, turn: ModelTurn, sequence: int) -> None:
        """Store a turn, unless an earlier run of the session did."""
        if turn.index < self._stored:
            return
        result = TurnResult(
            index=turn.index,
            sequence=sequence,
            sub_structure=turn.sub_structure,
            results=[(action.ok, action.reason, action.feedback) for action in turn.actions],
        )
        with self._gate.released():
            self._turns.append(self._lease, result)


@dataclass(frozen=True, slots=True, kw_only=True)
class ConstructHandler:
    """Handler that runs construction sessions."""

    store: Store
    artifacts: ArtifactStore
    queues: Queues
    registry: ModelRegistry
    clients: ModelClients
    sessions: Sessions
    gate: ConcurrencyGate

    def __call__(self, active: ActiveLease) -> None:
        """Run the job's session until it needs a simulation or ends."""
        job = active.lease.job
        host, keeper = self._host(active), TurnKeeper(self.store.turns, active.lease, self.gate)
        with self.gate.acquired():
            session, result = self.sessions.run(job, host, keeper)
        self._move_on(active, session, result)

    def _host(self, active: ActiveLease) -> JournalHost:
        lease, job = active.lease, active.lease.job
        client = self.clients.for_config(job.model_config)
        return JournalHost(
            entries=[] if lease.first else self.store.journal.read(job.id),
            rollouts=[] if lease.first else self.store.rollouts.read(job.id),
            limits=session_limits(job.track_config, job.limits),
            load_trajectory=lambda digest: read_trajectory(self.artifacts.get(digest)),
            requester=Requester(
                client=client,
                journal=self.store.journal,
                active=active,
                budgets=self.store.budgets,
                price=partial(price_usd, self.registry.models[job.model]),
                gate=self.gate,
                owner=job.owner or "",
            ),
        )

    def _move_on(
        self, active: ActiveLease, session: Session, result: results.SessionResult
    ) -> None:
        """Store how the session ended, and advance the job accordingly."""
        lease = active.lease
        match result:
            case results.Suspended():
                self._suspend(lease, session, result)
            case results.Finished():
                self._finish(lease, session)
            case results.Failed():
                self._fail(lease, session, result)
            case results.BudgetExhausted(shortage=shortage):
                self._hand_back(lease, shortage)
            case results.Drained():
                active.returned = True
            case _:
                assert_never(result)

    def _hand_back(self, lease: Lease, shortage: BudgetShortage) -> None:
        """Release the job unchanged, and stop the sweep whose budget is exhausted."""
        with self.store.lifecycle.command() as connection:
            self.store.leases.advance(
                lease,
                to=JobState.QUEUED,
                connection=connection,
                result=AttemptResult.BUDGET_EXHAUSTED,
                note=shortage.detail,
                detail=shortage.detail,
            )
            self.store.lifecycle.exhaust(shortage.budget_id, shortage.detail, connection=connection)

    def _suspend(self, lease: Lease, session: Session, suspended: results.Suspended) -> None:
        """Store the machine and queue the job for its simulator, in one transaction."""
        job, machine = lease.job, self.artifacts.put(machine_bytes(suspended.machine), JSON)
        artifacts = {**self._store_artifacts(session), "machine": machine}
        engine = str(job.track_config["simulator"])
        request = RolloutRequest(
            number=suspended.number,
            final=suspended.final,
            engine=engine,
            machine_hash=machine.hash,
            controls=to_builtins(suspended.controls),
            seed=None if suspended.final else test_seed(job, session.task, suspended.number),
        )
        queue = simulate_queue(engine)
        with self.store.database.transaction() as connection:
            self.store.results.attach(job.id, artifacts, connection=connection)
            self.store.rollouts.request(job.id, request, connection=connection)
            counts = _counts(session)
            self.store.leases.requeue(
                lease, stage=Stage.SIMULATE, queue=queue, connection=connection, **counts
            )
        self.queues.wake(queue)

    def _fail(self, lease: Lease, session: Session, failed: results.Failed) -> None:
        """Score a session that ended without a simulation, and keep the machine it built."""
        is_own = failed.reason in lease.job.limits
        score = failure_score(
            lease.job,
            session.task,
            session.machine,
            outcome=Outcome.LIMIT if is_own else Outcome.CONSTRUCTION_FAILED,
            reason=failed.reason,
            detail=failed.detail,
        )
        artifacts = self._store_artifacts(session)
        with self.store.database.transaction() as connection:
            self.store.results.attach(lease.job.id, artifacts, connection=connection)
            self.store.results.finish(lease, score, connection=connection, **_counts(session))

    def _finish(self, lease: Lease, session: Session) -> None:
        """End a session whose machine was simulated; trials in varied worlds may remain."""
        artifacts, records = self._store_artifacts(session), self.store.rollouts.read(lease.job.id)
        with self.store.database.transaction() as connection:
            self.store.results.attach(lease.job.id, artifacts, connection=connection)
            counts, task = _counts(session), session.task
            queue = finish_or_vary(
                self.store, lease, records, task=task, connection=connection, **counts
            )
        if queue is not None:
            self.queues.wake(queue)

    def _store_artifacts(self, session: Session) -> dict[str, ArtifactInfo]:
        """Store the transcript and machine of a session that ended, and return them by name."""
        artifacts = {"transcript": self.artifacts.put(session.transcript.to_json(), JSON)}
        if session.machine is not None and session.machine.started:
            artifacts["machine"] = self.artifacts.put(machine_bytes(session.machine), JSON)
        return artifacts


def _counts(session: Session) -> dict[str, object]:
    refusals = session.transcript.refusals
    return {
        "actions": session.transcript.actions,
        "refused_actions": sum(refusals.values()),
        "refusals": refusals,
    }
