"""Active leases: the leases that a process works under, kept alive by heartbeats."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

import structlog
from sqlalchemy.exc import OperationalError

from buildarena_backend.leases.leases import Lease, Leases
from buildarena_backend.periodic import Periodic

log = structlog.get_logger(__name__)

BEATS_PER_LEASE = 4
"""A lease outlives this many heartbeats less one that got lost."""
HAND_BACK_TRIES = 2
"""A statement over many jobs may meet another that holds some of them."""
LONGEST_UNAWARE_S = 1.0
"""Time after which a worker notices its job's cancellation, between rarer heartbeats."""


@dataclass(slots=True, eq=False)
class ActiveLease:
    """A lease in use, in its last known state.

    Threads that wait under it are notified at once when it is lost or drained.

    Attributes:
        budgeted: Whether a budget pays for the job.
        lost: Whether it ended: by its time, because the job was cancelled, or because its worker
            has no more time to stop.
        draining: Whether its worker stops: what is under way may be finished, nothing is begun.
        returned: Whether the work under it was left where another worker takes it up; the lease
            goes back with all others of its worker.
    """

    lease: Lease
    budgeted: bool
    lost: bool = False
    draining: bool = False
    returned: bool = False
    _changed: threading.Condition = field(default_factory=threading.Condition)
    _called: list[Callable[[], object]] = field(default_factory=list)

    def lose(self) -> None:
        """Note that the lease is lost, and notify all waiting threads."""
        with self._changed:
            self.lost = True
            called, self._called = self._called, []
            self._changed.notify_all()
        for callback in called:
            callback()

    def drain(self) -> None:
        """Note that the worker stops, and notify all waiting threads."""
        with self._changed:
            self.draining = True
            called = list(self._called)
            self._changed.notify_all()
        for callback in called:
            callback()

    def wait(self, seconds: float) -> None:
        """Wait until the time is over or the lease is lost or drained."""
        with self._changed:
            self._changed.wait_for(lambda: self.lost or self.draining, timeout=seconds)

    @contextmanager
    def calling(self, callback: Callable[[], object]) -> Iterator[None]:
        """Have something called when the lease is drained or lost in the block, or was before it.

        Args:
            callback: Called once for each, from any thread.
        """
        with self._changed:
            changed = self.lost or self.draining
            if not self.lost:
                self._called.append(callback)
        if changed:
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
        on_beat: Called at each beat, for example to report that the worker is alive.
    """

    def __init__(self, leases: Leases, on_beat: Callable[[], None]) -> None:
        self._leases = leases
        self._on_beat = on_beat
        self._active: dict[str, ActiveLease] = {}
        self._lock = threading.Lock()
        self._changed = threading.Condition(self._lock)
        self._draining = self._stopped = False
        beat_s = leases.duration.total_seconds() / BEATS_PER_LEASE
        self._looks_per_beat = math.ceil(beat_s / LONGEST_UNAWARE_S)
        self._looks = 0
        period_s = beat_s / self._looks_per_beat
        self._thread = Periodic(self._look_or_beat, name="leases", period_s=period_s)
        self._thread.expected = OperationalError

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def drain(self, within_s: float) -> None:
        """Begin nothing more, and wait until running work is finished.

        Args:
            within_s: Maximum duration. Heartbeats continue meanwhile.
        """
        with self._lock:
            self._draining = True
            active = list(self._active.values())
        for lease in active:
            lease.drain()
        with self._changed:
            self._changed.wait_for(self._is_idle, timeout=within_s)

    def stop(self) -> None:
        """Stop the thread and hand back, in one statement, every lease that is still active."""
        self._thread.stop()
        with self._lock:
            self._stopped = True
            active, self._active = list(self._active.values()), {}
        for lease in active:
            lease.lose()
        self._hand_back([lease.lease for lease in active])

    @contextmanager
    def keeping(self, lease: Lease) -> Iterator[ActiveLease]:
        """Keep a lease alive inside the block, and beyond it where the block returned it."""
        active = ActiveLease(lease, lease.budgeted)
        with self._lock:
            active.draining, late = self._draining, self._stopped
            if not late:
                self._active[lease.job.id] = active
        if late:  # it was claimed while the worker began to shut down
            active.lose()
            self._hand_back([lease])
        try:
            yield active
        finally:
            if active.returned and not active.lost:
                with self._changed:
                    self._changed.notify_all()
            else:
                self._forget(active)

    def _is_idle(self) -> bool:
        return all(active.returned for active in self._active.values())

    def _hand_back(self, leases: Sequence[Lease]) -> None:
        for _ in range(HAND_BACK_TRIES):
            try:
                waiting = self._leases.hand_back_all(leases)
            except OperationalError as error:
                log.warning("not_handed_back", why=str(error).splitlines()[0])
                continue
            gone = [lease.job.id for lease in leases if lease.job.id not in waiting]
            if leases:
                log.info("handed_back", jobs=len(waiting), over=gone)
            return

    def _look_or_beat(self) -> None:
        self._looks += 1
        beats = self._looks % self._looks_per_beat == 0
        if beats:
            self._on_beat()
        self._look(self._leases.heartbeat if beats else self._leases.held)

    def _look(self, ask: Callable[[Sequence[Lease]], Mapping[str, bool]]) -> None:
        with self._lock:
            every = list(self._active.values())
        renewed = ask([active.lease for active in every])
        for active in every:
            job_id = active.lease.job.id
            if job_id in renewed:
                active.budgeted = renewed[job_id]
            else:
                log.warning("lease_lost", job=job_id, token=active.lease.token)
                self._forget(active)

    def _forget(self, active: ActiveLease) -> None:
        active.lose()
        job_id = active.lease.job.id
        with self._changed:
            if self._active.get(job_id) is active:
                del self._active[job_id]
            self._changed.notify_all()
