"""The construct stage: runs or resumes a job's session, and moves the job on."""

from __future__ import annotations

from decimal import Decimal

from buildarena_pipeline.catalog.models import ModelRegistry
from buildarena_pipeline.catalog.prices import price_usd
from buildarena_pipeline.catalog.prompt_packs import PromptPack, PromptPacks
from buildarena_pipeline.errors import PermanentError, StartupError
from buildarena_pipeline.runtime.active_lease import ActiveLease
from buildarena_pipeline.runtime.context import Context
from buildarena_pipeline.runtime.machine_documents import machine_bytes
from buildarena_pipeline.runtime.scoring import failure_score, rollout_score, task_of
from buildarena_simulation import read_trajectory
from buildarena_store import (
    Job,
    JobScore,
    JournalEntry,
    Lease,
    Outcome,
    RolloutRequest,
    Stage,
    StaleLeaseError,
)
from buildarena_store.states import AttemptResult, JobState, simulate_queue
from buildarena_worker.budget_guard import BudgetGuard, BudgetUsedUpError, Price
from buildarena_worker.concurrency_gate import ConcurrencyGate
from buildarena_worker.errors import (
    ConstructionFailedError,
    JournalMismatchError,
    LeaseLostError,
    LimitReachedError,
)
from buildarena_worker.providers import ModelClients
from buildarena_worker.session.host import SessionIO, SuspendedError
from buildarena_worker.session.session import Session
from buildarena_worker.workflow import SessionEnd, Workflows
from buildarena_worker.workflow.rounds import Loop, run_session

JSON = "application/json"


class ConstructHandler:
    """Runs construction sessions.

    Args:
        context: The process' connections.
        registry: Models and providers.
    """

    def __init__(self, context: Context, registry: ModelRegistry) -> None:
        self._context = context
        self._registry = registry
        self._clients = ModelClients(registry, context.settings.broker_url)
        self._packs = PromptPacks(context.settings.prompt_packs)
        self._workflows = Workflows(context.settings.workflows)
        self._gate = ConcurrencyGate()

    def __call__(self, active: ActiveLease) -> None:
        """Runs the job's session as far as it gets: to a simulation, or to its end."""
        lease, job = active.lease, active.lease.job
        guard = BudgetGuard(self._context.store.budgets, active, self._price_of(job))
        task = task_of(job, self._context.tasks)
        pack = pack_of(job, self._packs)
        io = SessionIO(
            client=self._clients.for_config(job.model_config),
            entries=[] if lease.first else self._context.store.journal.read(job.id),
            rollouts=[] if lease.first else self._context.store.rollouts.read(job.id),
            append=lambda entry: self._append(lease, entry),
            still_held=lambda: not active.lost,
            limits=job.limits,
            load_trajectory=lambda digest: read_trajectory(self._context.artifacts.get(digest)),
            reserve=guard,
            waiting=self._gate.released,
        )
        session = Session(task=task, seed=job.seed, model_config=job.model_config, pack=pack, io=io)
        try:
            workflow = self._workflows.find(str(job.track_config["workflow"]))
            with self._gate.acquired():
                end = run_session(session, workflow, loop_of(job))
        except SuspendedError as suspended:
            self._suspend(lease, session, suspended)
        except BudgetUsedUpError as used_up:
            self._stop(lease, used_up)
        except ConstructionFailedError as failure:
            self._fail(lease, session, Outcome.CONSTRUCTION_FAILED, failure.reason, str(failure))
        except LimitReachedError as limit:
            self._fail(lease, session, Outcome.LIMIT, limit.limit, str(limit))
        except LeaseLostError as lost:
            raise StaleLeaseError(job.id, lease.token) from lost
        except JournalMismatchError as mismatch:
            raise PermanentError(str(mismatch), reason="journal_mismatch") from mismatch
        else:
            self._finish(lease, session, end)

    def _append(self, lease: Lease, entry: JournalEntry) -> None:
        try:
            self._context.store.journal.append(lease, entry)
        except StaleLeaseError:
            # The job was cancelled or lost meanwhile, but its budgets did pay for the reply.
            self._context.store.budgets.charge_lost(lease, entry.usage)
            raise

    def _price_of(self, job: Job) -> Price:
        entry = self._registry.models.get(job.model)

        def price(input_tokens: int, output_tokens: int) -> Decimal:
            if entry is None:
                return Decimal()
            return price_usd(
                entry, input_tokens=input_tokens, output_tokens=output_tokens, cached_tokens=0
            )

        return price

    def _stop(self, lease: Lease, used_up: BudgetUsedUpError) -> None:
        """Hands the job back as it is and stops the sweep whose budget is used up."""
        context, detail = self._context, str(used_up)
        with context.store.lifecycle.command() as connection:
            context.store.leases.advance(
                lease,
                to=JobState.QUEUED,
                connection=connection,
                result=AttemptResult.BUDGET_EXHAUSTED,
                note=detail,
                notified_at=None,
                detail=detail,
            )
            context.store.lifecycle.exhaust(
                used_up.shortage.budget_id, detail, connection=connection
            )

    def _suspend(self, lease: Lease, session: Session, suspended: SuspendedError) -> None:
        """Keeps the machine and hands the job to its simulator, all in one transaction."""
        context, job = self._context, lease.job
        machine = context.artifacts.put(machine_bytes(suspended.machine), JSON)
        transcript = context.artifacts.put(session.transcript.to_json(), JSON)
        engine = str(job.track_config["simulator"])
        controls = None
        if suspended.controls is not None:
            controls = [
                {"time_s": press.time_s, "key": press.key, "hold_for_s": press.hold_for_s}
                for press in suspended.controls
            ]
        request = RolloutRequest(
            number=suspended.number,
            final=suspended.final,
            engine=engine,
            machine_hash=machine.hash,
            controls=controls,
        )
        queue = simulate_queue(engine)
        with context.store.database.transaction() as connection:
            made = {"machine": machine, "transcript": transcript}
            context.store.results.attach(job.id, made, connection=connection)
            context.store.rollouts.request(job.id, request, connection=connection)
            context.store.leases.queue_again(
                lease,
                stage=Stage.SIMULATE,
                queue=queue,
                connection=connection,
                **_counts(session),
            )
        context.queues.notify_one(queue, job.id)

    def _fail(
        self, lease: Lease, session: Session, outcome: Outcome, reason: str, detail: str
    ) -> None:
        """Scores a session that ended without a simulation; what it built is kept."""
        score = failure_score(
            lease.job, session.task, session.machine, outcome=outcome, reason=reason, detail=detail
        )
        self._write_end(lease, session, score)

    def _finish(self, lease: Lease, session: Session, end: SessionEnd) -> None:
        self._write_end(lease, session, rollout_score(lease.job, end.best))

    def _write_end(self, lease: Lease, session: Session, score: JobScore) -> None:
        context, job = self._context, lease.job
        made = {"transcript": context.artifacts.put(session.transcript.to_json(), JSON)}
        if session.machine is not None and session.machine.started:
            made["machine"] = context.artifacts.put(machine_bytes(session.machine), JSON)
        with context.store.database.transaction() as connection:
            context.store.results.attach(job.id, made, connection=connection)
            context.store.results.finish(lease, score, connection=connection, **_counts(session))


def _counts(session: Session) -> dict[str, object]:
    refusals = session.transcript.refusals
    return {
        "actions": session.transcript.actions,
        "refused_actions": sum(refusals.values()),
        "refusals": refusals,
    }


def pack_of(job: Job, packs: PromptPacks) -> PromptPack:
    """The job's prompt pack, as long as it is still the one that the job was submitted with.

    Raises:
        PermanentError: It has changed, or it is not on this worker.
    """
    name, wanted = str(job.track_config["prompts"]), job.track_config["prompts_digest"]
    try:
        pack = packs.load(name)
    except StartupError as error:
        raise PermanentError(str(error), reason="no_prompts") from error
    if pack.digest != wanted:
        raise PermanentError(
            f"prompt pack {pack.name!r} has changed since the job was submitted: submit it again "
            "to run it on the new track",
            reason="prompts_changed",
        )
    return pack


def loop_of(job: Job) -> Loop:
    """What the job's track says about rounds, analyst and example."""
    config = job.track_config
    return Loop(
        rounds=int(config["rounds"]),
        analyst=bool(config["analyst"]),
        one_shot=bool(config["one_shot"]),
    )
