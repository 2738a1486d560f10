"""The reaper: recovers jobs of dead workers and notifies workers of jobs that wait unnoticed.

Every worker process and the API run one in a thread. The broker lets one of them at the work each
second, so that the others stay idle; where it is away all of them try, and a lock in the database
lets one at a time. So no process is needed for it and none can be missing.
"""

from __future__ import annotations

import structlog
from sqlalchemy import text
from sqlalchemy.exc import SQLAlchemyError

from buildarena_backend.periodic import Periodic
from buildarena_backend.process.context import Context
from buildarena_backend.process.notify import notify_waiting
from buildarena_backend.queue.queues import MAX_SENT, MAX_WAITING
from buildarena_backend.states import VERIFY_QUEUE

REAPER_LOCK = 0x726561706572  # "reaper"
PERIOD_S = 1.0
SELDOM_EVERY = 5
"""Runs after which that is done which can wait for some seconds."""
FORGETS_EVERY = 600
"""Runs after which what is known of old leases is removed."""

log = structlog.get_logger(__name__)


class Reaper:
    """Runs every second until it is stopped.

    Args:
        context: The process' connections.
        period_s: Seconds between runs.
    """

    def __init__(self, context: Context, *, period_s: float = PERIOD_S) -> None:
        self._context = context
        self._most: dict[str, int] = {}
        self._runs = 0
        self._period_s = period_s
        self._thread = Periodic(self._reap_safely, name="reaper", period_s=period_s)

    def start(self) -> None:
        """Starts the thread."""
        self._thread.start()

    def stop(self) -> None:
        """Stops the thread and waits for it."""
        self._thread.stop()

    def _reap_safely(self) -> None:
        # Asking the broker costs a tenth of a run; nothing rests on its answer.
        if not self._context.queues.is_first("reaper", 0.9 * self._period_s):
            return
        try:
            self.reap()
        except SQLAlchemyError as error:
            log.warning("reaper_failed", error=str(error).splitlines()[0])
        except Exception:
            # Without a reaper, lost messages stay lost: it must outlive what nobody foresaw.
            log.exception("reaper_failed")

    def reap(self) -> None:
        """Runs once, unless another process is at it, or there is nothing to do."""
        run, self._runs = self._runs, self._runs + 1
        if run % SELDOM_EVERY and self._context.store.waiting.is_quiet():
            return
        with self._context.store.database.engine.connect() as connection:
            lock = text("SELECT pg_try_advisory_xact_lock(:key)")
            if not connection.execute(lock, {"key": REAPER_LOCK}).scalar_one():
                return
            recovered = self._context.store.leases.recover()
            if recovered:
                log.info("recovered", jobs=recovered)
            for queue in self._context.store.waiting.queues():
                self._notify(queue)
            if run % SELDOM_EVERY == 0:
                self._do_seldom()
            if run % FORGETS_EVERY == 0:
                self._context.store.leases.forget_ended()

    def _do_seldom(self) -> None:
        store = self._context.store
        store.external_calls.abandon_idle()
        checks = store.verifications.to_notify(MAX_WAITING)
        if checks:
            self._context.queues.announce(VERIFY_QUEUE, checks)

    def _notify(self, queue: str) -> None:
        """Notifies a queue's workers; of twice as many jobs each time they have taken all."""
        most = self._most.get(queue, MAX_WAITING)
        waiting = notify_waiting(self._context, queue, most=most)
        self._most[queue] = MAX_WAITING if waiting != 0 else min(2 * most, MAX_SENT)
