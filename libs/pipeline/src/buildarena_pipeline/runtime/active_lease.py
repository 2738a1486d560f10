"""Active leases: the leases that a process works under, kept alive by heartbeats."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

import structlog
from sqlalchemy.exc import OperationalError

from buildarena_pipeline.periodic import Periodic
from buildarena_store import Lease, Leases, StaleLeaseError

log = structlog.get_logger(__name__)

BEATS_PER_LEASE = 4
"""A lease outlives this many heartbeats less one that got lost."""
LONGEST_UNAWARE_S = 1.0
"""So long after its job was cancelled a worker knows, although it sends heartbeats more rarely."""


@dataclass(slots=True, eq=False)
class ActiveLease:
    """A lease that is worked under, as it was last found.

    Those who wait for something under it hear at once when it is lost.

    Attributes:
        lease: The lease.
        budgeted: Whether a budget pays for the job.
        lost: Whether it ended: by its time, because the job was cancelled, or because its worker
            shuts down.
    """

    lease: Lease
    budgeted: bool
    lost: bool = False
    _changed: threading.Condition = field(default_factory=threading.Condition)
    _called: list[Callable[[], object]] = field(default_factory=list)

    def lose(self) -> None:
        """Notes that the lease is lost, and tells everybody who waits."""
        with self._changed:
            self.lost = True
            called, self._called = self._called, []
            self._changed.notify_all()
        for callback in called:
            callback()

    def wait(self, seconds: float) -> None:
        """Waits for so long, or until the lease is lost."""
        with self._changed:
            self._changed.wait_for(lambda: self.lost, timeout=seconds)

    @contextmanager
    def calling(self, callback: Callable[[], object]) -> Iterator[None]:
        """Has something called when the lease is lost inside the block, or was before it.

        Args:
            callback: Called once, from any thread.
        """
        with self._changed:
            lost = self.lost
            if not lost:
                self._called.append(callback)
        if lost:
            callback()
        try:
            yield
        finally:
            with self._changed:
                if callback in self._called:
                    self._called.remove(callback)


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
        self._stopped = False
        beat_s = leases.duration.total_seconds() / BEATS_PER_LEASE
        self._looks_per_beat = math.ceil(beat_s / LONGEST_UNAWARE_S)
        self._looks = 0
        period_s = beat_s / self._looks_per_beat
        self._thread = Periodic(self._look_safely, name="leases", period_s=period_s)

    def start(self) -> None:
        """Starts the thread."""
        self._thread.start()

    def stop(self) -> None:
        """Stops the thread and hands back every lease that is still active."""
        self._thread.stop()
        with self._lock:
            self._stopped = True
            active, self._active = list(self._active.values()), {}
        for lease in active:
            lease.lose()
        for lease in active:
            self._hand_back(lease)

    @contextmanager
    def keeping(self, lease: Lease) -> Iterator[ActiveLease]:
        """Keeps a lease alive inside the block."""
        active = ActiveLease(lease, lease.budgeted)
        with self._lock:
            late = self._stopped
            if not late:
                self._active[lease.job.id] = active
        if late:  # it was claimed while the worker began to shut down
            active.lose()
            self._hand_back(active)
        try:
            yield active
        finally:
            self._forget(active)

    def _hand_back(self, active: ActiveLease) -> None:
        try:
            self._leases.hand_back(active.lease)
        except (StaleLeaseError, OperationalError):
            log.info("not_handed_back", job=active.lease.job.id)

    def _look_safely(self) -> None:
        self._looks += 1
        beats = self._looks % self._looks_per_beat == 0
        try:
            if beats:
                self._on_beat()
            self._look(self._leases.heartbeat if beats else self._leases.held)
        except OperationalError as error:
            log.warning("heartbeat_failed", error=str(error).splitlines()[0])
        except Exception:
            # Without this thread the process would lose every lease from now on.
            log.exception("heartbeat_failed")

    def _look(self, ask: Callable[[Sequence[Lease]], Mapping[str, bool]]) -> None:
        with self._lock:
            every = list(self._active.values())
        kept = ask([active.lease for active in every])
        for active in every:
            job_id = active.lease.job.id
            if job_id in kept:
                active.budgeted = kept[job_id]
            else:
                log.warning("lease_lost", job=job_id, token=active.lease.token)
                self._forget(active)

    def _forget(self, active: ActiveLease) -> None:
        active.lose()
        job_id = active.lease.job.id
        with self._lock:
            if self._active.get(job_id) is active:
                del self._active[job_id]
