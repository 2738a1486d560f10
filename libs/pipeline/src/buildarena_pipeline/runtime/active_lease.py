"""Active leases: the leases that a process works under, kept alive by heartbeats."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import structlog
from sqlalchemy.exc import OperationalError

from buildarena_pipeline.periodic import Periodic
from buildarena_store import Lease, Leases, StaleLeaseError

log = structlog.get_logger(__name__)

BEATS_PER_LEASE = 4
"""A lease outlives this many heartbeats less one that got lost."""


@dataclass(slots=True, eq=False)
class ActiveLease:
    """A lease that is worked under, as the last heartbeat found it.

    Attributes:
        lease: The lease.
        budgeted: Whether a budget pays for the job.
        lost: Whether it ended: by its time, or because the job was cancelled.
    """

    lease: Lease
    budgeted: bool
    lost: bool = False


class LeaseKeeper:
    """Sends heartbeats for all leases of a process from one thread.

    Args:
        leases: Where leases are.
        on_beat: Called at each beat, for example to report that the worker is alive.
    """

    def __init__(self, leases: Leases, on_beat: Callable[[], None]) -> None:
        self._leases = leases
        self._on_beat = on_beat
        self._active: dict[str, ActiveLease] = {}
        self._lock = threading.Lock()
        period_s = leases.duration.total_seconds() / BEATS_PER_LEASE
        self._thread = Periodic(self._beat_safely, name="leases", period_s=period_s)

    def start(self) -> None:
        """Starts the thread."""
        self._thread.start()

    def stop(self) -> None:
        """Stops the thread and hands back every lease that is still active."""
        self._thread.stop()
        with self._lock:
            active, self._active = list(self._active.values()), {}
        for lease in active:
            lease.lost = True
            try:
                self._leases.hand_back(lease.lease)
            except (StaleLeaseError, OperationalError):
                log.info("not_handed_back", job=lease.lease.job.id)

    @contextmanager
    def keeping(self, lease: Lease) -> Iterator[ActiveLease]:
        """Keeps a lease alive inside the block."""
        active = ActiveLease(lease, lease.budgeted)
        with self._lock:
            self._active[lease.job.id] = active
        try:
            yield active
        finally:
            self._forget(active)

    def _beat_safely(self) -> None:
        try:
            self._beat()
        except OperationalError as error:
            log.warning("heartbeat_failed", error=str(error).splitlines()[0])

    def _beat(self) -> None:
        self._on_beat()
        with self._lock:
            every = list(self._active.values())
        kept = self._leases.heartbeat([active.lease for active in every])
        for active in every:
            job_id = active.lease.job.id
            if job_id in kept:
                active.budgeted = kept[job_id]
            else:
                log.warning("lease_lost", job=job_id, token=active.lease.token)
                self._forget(active)

    def _forget(self, active: ActiveLease) -> None:
        active.lost = True
        job_id = active.lease.job.id
        with self._lock:
            if self._active.get(job_id) is active:
                del self._active[job_id]
