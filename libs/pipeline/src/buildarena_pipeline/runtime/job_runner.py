"""The job runner: how a worker takes a job, does its stage, and reports faults."""

from __future__ import annotations

import time
from typing import Protocol

import structlog
from sqlalchemy.exc import OperationalError

from buildarena_pipeline.errors import PermanentError, TransientError
from buildarena_pipeline.runtime.active_lease import ActiveLease, LeaseKeeper
from buildarena_pipeline.runtime.tracing import span
from buildarena_store import (
    ArtifactDamagedError,
    ArtifactMissingError,
    ArtifactStoreError,
    Lease,
    Leases,
    StaleLeaseError,
)

log = structlog.get_logger(__name__)

STORE_DELAY_S = 2.0
"""How long a job waits after the artifact store failed for the first time."""


class StageHandler(Protocol):
    """Does a job's stage. It may run twice for one job, so it must be idempotent."""

    def __call__(self, active: ActiveLease) -> None:
        """Works on the leased job and moves it on.

        Args:
            active: The right to work on the job; when it is lost, stop without writing.

        Raises:
            StaleLeaseError: The lease is over.
            TransientError: The job should be tried again.
            PermanentError: The job can't be done.
        """


class JobRunner:
    """Runs a handler on the jobs that messages name.

    Args:
        leases: Where jobs are claimed.
        handler: Does the work.
        keeper: Keeps leases alive.
        owner: The worker's id.
    """

    def __init__(
        self, leases: Leases, handler: StageHandler, keeper: LeaseKeeper, owner: str
    ) -> None:
        self._leases = leases
        self._handler = handler
        self._keeper = keeper
        self._owner = owner

    def process_next(self, queue: str, job_id: str) -> None:
        """Takes one waiting job of the queue, the named one if possible, and does its stage."""
        try:
            lease = self._leases.claim(queue, owner=self._owner, hint=job_id)
        except OperationalError as error:
            log.warning("claim_failed", job=job_id, error=str(error).splitlines()[0])
            return
        if lease is None:
            return
        started = time.perf_counter()
        bound = log.bind(stage=lease.job.stage, token=lease.token)
        with (
            structlog.contextvars.bound_contextvars(job=lease.job.id),
            self._keeper.keeping(lease) as active,
        ):
            try:
                with span(lease.job.stage, job=lease.job.id, token=lease.token):
                    self._handler(active)
            except StaleLeaseError:
                bound.warning("lease_over")
            except TransientError as error:
                self._retry_later(lease, error)
            except PermanentError as error:
                self._give_up(lease, error)
            except (ArtifactStoreError, ArtifactMissingError, ArtifactDamagedError) as error:
                self._retry_later(lease, _store_fault(error))
            except OperationalError as error:
                bound.warning("database_fault", error=str(error).splitlines()[0])
            except Exception as error:  # noqa: BLE001 - a bug must not cost the job; it is logged whole
                bound.exception("handler_failed")
                text = f"{type(error).__name__}: {error}"
                self._retry_later(lease, TransientError(text, reason="internal_error"))
            else:
                bound.info("stage_done", seconds=round(time.perf_counter() - started, 3))

    def _retry_later(self, lease: Lease, error: TransientError) -> None:
        log.warning("transient_fault", reason=error.reason, detail=str(error))
        try:
            self._leases.fault(
                lease,
                str(error),
                delay_s=error.delay_s,
                reason=error.reason,
                endless=error.endless,
            )
        except (StaleLeaseError, OperationalError) as failure:
            log.warning("fault_not_recorded", error=str(failure))

    def _give_up(self, lease: Lease, error: PermanentError) -> None:
        log.error("permanent_fault", reason=error.reason, detail=str(error))
        try:
            self._leases.give_up(lease, str(error), reason=error.reason)
        except (StaleLeaseError, OperationalError) as failure:
            log.warning("fault_not_recorded", error=str(failure))


def _store_fault(error: Exception) -> TransientError:
    """A store that fails is waited for; bytes that are gone may come back from a backup."""
    fails = isinstance(error, ArtifactStoreError)
    return TransientError(
        str(error),
        reason="artifact_store" if fails else "artifact_lost",
        delay_s=STORE_DELAY_S,
        endless=fails,
    )
