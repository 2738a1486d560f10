"""Stages: how a worker takes a job, keeps its lease alive, and reports faults."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Protocol

import structlog
from sqlalchemy.exc import OperationalError

from buildarena_pipeline.errors import PassingFaultError, PermanentFaultError
from buildarena_pipeline.runtime.context import Context
from buildarena_pipeline.runtime.periodic import Periodic
from buildarena_pipeline.runtime.tracing import span
from buildarena_store import Lease, StaleLeaseError

log = structlog.get_logger(__name__)


@dataclass(slots=True, eq=False)
class Hold:
    """A lease that is worked under, as the last heartbeat found it.

    Attributes:
        lease: The lease.
        budgeted: Whether a budget pays for the job.
        over: Whether it ended: by its time, or because the job was cancelled.
    """

    lease: Lease
    budgeted: bool
    over: bool = False


class StageHandler(Protocol):
    """Does a job's stage. It may run twice for one job, so it must be idempotent."""

    def __call__(self, hold: Hold) -> None:
        """Works on the leased job and moves it on.

        Args:
            hold: The right to work on the job; when it is over, stop without writing.

        Raises:
            StaleLeaseError: The lease is over.
            PassingFaultError: The job should be tried again.
            PermanentFaultError: The job can't be done.
        """


class LeaseKeeper:
    """Sends heartbeats for all leases of a process from one thread.

    Args:
        context: The process' connections.
        on_beat: Called at each beat, for example to report that the worker lives.
    """

    def __init__(self, context: Context, on_beat: Callable[[], None]) -> None:
        self._context = context
        self._on_beat = on_beat
        self._held: dict[str, Hold] = {}
        self._guard = threading.Lock()
        period_s = context.settings.lease_s / 4
        self._thread = Periodic(self._beat_safely, name="leases", period_s=period_s)

    def start(self) -> None:
        """Starts the thread."""
        self._thread.start()

    def stop(self) -> None:
        """Stops the thread and hands back every lease that is still held."""
        self._thread.stop()
        with self._guard:
            held, self._held = list(self._held.values()), {}
        for hold in held:
            hold.over = True
            try:
                self._context.leases.hand_back(hold.lease)
            except (StaleLeaseError, OperationalError):
                log.info("not_handed_back", job=hold.lease.job.id)

    @contextmanager
    def keeping(self, lease: Lease) -> Iterator[Hold]:
        """Keeps a lease alive inside the block."""
        hold = Hold(lease, lease.budgeted)
        with self._guard:
            self._held[lease.job.id] = hold
        try:
            yield hold
        finally:
            self._forget(hold)

    def _beat_safely(self) -> None:
        try:
            self._beat()
        except OperationalError as error:
            log.warning("heartbeat_failed", error=str(error).splitlines()[0])

    def _beat(self) -> None:
        self._on_beat()
        with self._guard:
            held = list(self._held.values())
        kept = self._context.leases.heartbeat([hold.lease for hold in held])
        for hold in held:
            job_id = hold.lease.job.id
            if job_id in kept:
                hold.budgeted = kept[job_id]
            else:
                log.warning("lease_lost", job=job_id, token=hold.lease.token)
                self._forget(hold)

    def _forget(self, hold: Hold) -> None:
        hold.over = True
        job_id = hold.lease.job.id
        with self._guard:
            if self._held.get(job_id) is hold:
                del self._held[job_id]


class StageRunner:
    """Runs a handler on the jobs that messages speak of.

    Args:
        context: The process' connections.
        handler: Does the work.
        keeper: Keeps leases alive.
        owner: The worker's id.
    """

    def __init__(
        self, context: Context, handler: StageHandler, keeper: LeaseKeeper, owner: str
    ) -> None:
        self._context = context
        self._handler = handler
        self._keeper = keeper
        self._owner = owner

    def look(self, queue: str, job_id: str) -> None:
        """Takes one waiting job of the queue, the named one if possible, and does its stage."""
        try:
            lease = self._context.leases.claim(queue, owner=self._owner, hint=job_id)
        except OperationalError as error:
            log.warning("claim_failed", job=job_id, error=str(error).splitlines()[0])
            return
        if lease is None:
            return
        started = time.perf_counter()
        bound = log.bind(stage=lease.job.stage, token=lease.token)
        with (
            structlog.contextvars.bound_contextvars(job=lease.job.id),
            self._keeper.keeping(lease) as hold,
        ):
            try:
                with span(lease.job.stage, job=lease.job.id, token=lease.token):
                    self._handler(hold)
            except StaleLeaseError:
                bound.warning("lease_over")
            except PassingFaultError as fault:
                self._report(lease, fault)
            except PermanentFaultError as fault:
                self._give_up(lease, fault)
            except OperationalError as error:
                bound.warning("database_fault", error=str(error).splitlines()[0])
            except Exception as error:  # noqa: BLE001 - a bug must not cost the job; it is logged whole
                bound.exception("handler_failed")
                text = f"{type(error).__name__}: {error}"
                self._report(lease, PassingFaultError(text, reason="internal_error"))
            else:
                bound.info("stage_done", seconds=round(time.perf_counter() - started, 3))

    def _report(self, lease: Lease, fault: PassingFaultError) -> None:
        log.warning("passing_fault", reason=fault.reason, detail=str(fault))
        try:
            self._context.leases.fault(
                lease, str(fault), delay_s=fault.delay_s, reason=fault.reason
            )
        except (StaleLeaseError, OperationalError) as error:
            log.warning("fault_not_recorded", error=str(error))

    def _give_up(self, lease: Lease, fault: PermanentFaultError) -> None:
        log.error("permanent_fault", reason=fault.reason, detail=str(fault))
        try:
            with self._context.database.transaction() as connection:
                self._context.leases.give_up(
                    lease, str(fault), reason=fault.reason, connection=connection
                )
        except (StaleLeaseError, OperationalError) as error:
            log.warning("fault_not_recorded", error=str(error))
