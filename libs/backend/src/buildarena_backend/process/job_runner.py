"""The job runner, which takes a job, does its stage, and reports faults."""

from __future__ import annotations

import math
import threading
import time
from collections import Counter
from typing import Protocol

import structlog
from opentelemetry.trace import SpanKind
from sqlalchemy.exc import OperationalError

from buildarena_backend.database.text import clean
from buildarena_backend.errors import (
    ArtifactDamagedError,
    ArtifactMissingError,
    ArtifactStoreError,
    PermanentError,
    StaleLeaseError,
    TransientError,
)
from buildarena_backend.leases.claiming import OPERATOR
from buildarena_backend.leases.leases import Lease, Leases
from buildarena_backend.process.active_lease import ActiveLease, LeaseKeeper
from buildarena_backend.telemetry.tracing import span

log = structlog.get_logger(__name__)

INTERNAL_DELAY_S = 2.0
"""A thread takes its next job at once: without a delay it would meet a short trouble again and
again, until the job is given up."""
STORE_DELAY_S = 2.0
"""Wait of a job after the first failure of the artifact store."""
SLICE_S = 0.25
"""Time for which a process that does one job at a time continues to take jobs for one message; only
after it can a request to stop arrive."""
LONGEST_DETAIL = 2000
"""Characters of a fault's stored message; some quote untrusted data."""


class StageHandler(Protocol):
    """Does a job's stage. It may run twice for one job, so it must be idempotent."""

    def __call__(self, active: ActiveLease) -> None:
        """Work on the leased job and move it on.

        Args:
            active: The right to work on the job; when it is lost, stop without writing.

        Raises:
            StaleLeaseError: The lease is over.
            TransientError: The job should be tried again.
            PermanentError: The job can't be done.
        """


class JobRunner:
    """Runs a handler on the jobs that wait.

    Args:
        keeper: Keeps leases alive.
        owner: The worker's id.
        slots: Slots shared by the owners of its jobs; one slot for a worker of one job at a time.
    """

    def __init__(
        self,
        leases: Leases,
        handler: StageHandler,
        keeper: LeaseKeeper,
        owner: str,
        slots: OwnerSlots | None = None,
    ) -> None:
        self._leases = leases
        self._handler = handler
        self._keeper = keeper
        self._owner = owner
        self._slots = slots or OwnerSlots(1)
        self._claiming = threading.Lock()
        self._last: str | None = None
        self._stopping = False

    def stop(self) -> None:
        """Take no further job; a claim under way ends first, so none follows a hand-back."""
        with self._claiming:
            self._stopping = True

    def process_all(self, queue: str) -> None:
        """Do waiting jobs of the queue until none is left.

        A slot that comes free is so taken at once, although messages that found no slot are gone.
        """
        while self.process_next(queue):
            pass

    def process_some(self, queue: str) -> bool:
        """Do waiting jobs of the queue until none is left, or SLICE_S are over.

        A message costs as much as a job's books do, so that short jobs share one.

        Returns:
            Whether more may be left.
        """
        until = time.monotonic() + SLICE_S
        while self.process_next(queue):
            if time.monotonic() >= until:
                return True
        return False

    def process_next(self, queue: str) -> bool:
        """Take one waiting job of the queue and do its stage.

        Jobs of another owner than the last one's come first, those of owners without a free slot
        wait.

        Returns:
            Whether there was one.
        """
        lease = self._claim_next(queue)
        if lease is None:
            return False
        try:
            self._do_stage(lease)
        finally:
            with self._claiming:
                self._slots.release(lease.job.owner or OPERATOR)
        return True

    def _claim_next(self, queue: str) -> Lease | None:
        # One at a time: what an owner has must not change between looking and taking.
        with self._claiming:
            if self._stopping or not self._slots.free:
                return None
            try:
                lease = self._leases.claim(
                    queue,
                    owner=self._owner,
                    full=self._slots.full(),
                    last=self._last,
                )
            except OperationalError as error:
                log.warning("claim_failed", queue=queue, error=str(error).splitlines()[0])
                return None
            if lease is not None:
                self._last = lease.job.owner or OPERATOR
                self._slots.take(self._last)
            return lease

    def _do_stage(self, lease: Lease) -> None:
        started = time.perf_counter()
        bound = log.bind(stage=lease.job.stage, token=lease.token)
        with (
            structlog.contextvars.bound_contextvars(job=lease.job.id),
            self._keeper.keeping(lease) as active,
        ):
            try:
                with span(
                    lease.job.stage,
                    {"buildarena.job": lease.job.id, "buildarena.token": lease.token},
                    parent=lease.job.traceparent,
                    kind=SpanKind.CONSUMER,
                ):
                    self._handler(active)
            except StaleLeaseError:
                bound.warning("lease_over")
            except (TransientError, PermanentError) as error:
                self._record(lease, error)
            except (ArtifactStoreError, ArtifactMissingError, ArtifactDamagedError) as error:
                self._record(lease, _store_fault(error))
            except OperationalError as error:
                bound.warning("database_fault", error=str(error).splitlines()[0])
            except Exception as error:  # noqa: BLE001 - a bug must not cost the job; it is logged whole
                bound.exception("handler_failed")
                text = f"{type(error).__name__}: {error}"
                fault = TransientError(text, reason="internal_error", delay_s=INTERNAL_DELAY_S)
                self._record(lease, fault)
            else:
                bound.info("stage_done", seconds=round(time.perf_counter() - started, 3))

    def _record(self, lease: Lease, error: TransientError | PermanentError) -> None:
        detail = str(clean(str(error)))[:LONGEST_DETAIL]
        try:
            if isinstance(error, PermanentError):
                log.error("permanent_fault", reason=error.reason, detail=detail)
                self._leases.give_up(lease, detail, reason=error.reason)
            else:
                log.warning("transient_fault", reason=error.reason, detail=detail)
                self._leases.fault(
                    lease,
                    detail,
                    delay_s=error.delay_s,
                    reason=error.reason,
                    endless=error.endless,
                )
        except (StaleLeaseError, OperationalError) as failure:
            log.warning("fault_not_recorded", error=str(failure))


def _store_fault(error: Exception) -> TransientError:
    """Return the fault for a failing store; lost bytes may come back from a backup."""
    fails = isinstance(error, ArtifactStoreError)
    return TransientError(
        str(error),
        reason="artifact_store" if fails else "artifact_lost",
        delay_s=STORE_DELAY_S,
        endless=fails,
    )


ALPHA = 4
"""Slots that an owner may have for each free one."""


class OwnerSlots:
    """Limit on the slots of a process that one owner's jobs occupy at once.

    An owner may take a further slot only while it has fewer than four times as many as are free
    (dynamic thresholds; Choudhury and Hahne, 1998). So one owner alone never takes all, and there
    is room for the next one's first job at once; with five slots for every four that are
    configured, one owner alone still gets as many as are configured. Its user sees to it that one
    thread at a time takes one.

    Args:
        configured: Slots that one owner alone gets.

    Attributes:
        total: Slots of all owners together.
    """

    def __init__(self, configured: int) -> None:
        self._configured = configured
        self.total = math.ceil(configured * (ALPHA + 1) / ALPHA)
        self._taken: Counter[str] = Counter()

    @property
    def free(self) -> int:
        """Unused slots."""
        return self.total - self._taken.total()

    def full(self) -> list[str]:
        """Return the owners that may not take another slot now."""
        free = self.free
        return [
            owner
            for owner, count in self._taken.items()
            # The last one is left to an owner that has none.
            if free <= 1 or count >= min(self._configured, ALPHA * free)
        ]

    def take(self, owner: str) -> None:
        """Give an owner a slot."""
        self._taken[owner] += 1

    def release(self, owner: str) -> None:
        """Take a slot back."""
        self._taken[owner] -= 1
        if not self._taken[owner]:
            del self._taken[owner]
