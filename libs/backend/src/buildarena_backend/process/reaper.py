"""The reaper: recovers jobs of dead workers and notifies workers of jobs that wait unnoticed.

Every worker process and the API run one in a thread, and a lock in the database lets one at a time
work. So no process is needed for it and none can be missing.
"""

from __future__ import annotations

import structlog
from sqlalchemy import text
from sqlalchemy.exc import SQLAlchemyError

from buildarena_backend.periodic import Periodic
from buildarena_backend.process.context import Context
from buildarena_backend.states import VERIFY_QUEUE

REAPER_LOCK = 0x726561706572  # "reaper"
PERIOD_S = 1.0
WOKEN = 50
"""Workers of a queue that are woken in a run: those that are at work take further jobs anyway."""
SELDOM_EVERY = 5
"""Runs after which that is done which can wait for some seconds."""
FORGETS_EVERY = 600
"""Runs between removals of old leases' records."""

log = structlog.get_logger(__name__)


class Reaper(Periodic):
    """Runs every second until it is stopped."""

    def __init__(self, context: Context) -> None:
        super().__init__(self.reap, name="reaper", period_s=PERIOD_S)
        self.expected = SQLAlchemyError
        self._context = context
        self._runs = 0

    def reap(self) -> None:
        """Run once, unless another process runs it or there is nothing to do."""
        store, run = self._context.store, self._runs
        self._runs += 1
        if run % SELDOM_EVERY and store.waiting.is_quiet():
            return
        with store.database.engine.connect() as connection:
            lock = text("SELECT pg_try_advisory_xact_lock(:key)")
            if not connection.execute(lock, {"key": REAPER_LOCK}).scalar_one():
                return
            recovered = store.leases.recover()
            if recovered:
                log.info("recovered", jobs=recovered)
            for queue, jobs in store.waiting.queues(WOKEN).items():
                self._context.queues.wake(queue, jobs)
            if run % SELDOM_EVERY == 0:
                store.external_calls.abandon_idle()
                if checks := store.verifications.waiting(WOKEN):
                    self._context.queues.wake(VERIFY_QUEUE, checks)
            if run % FORGETS_EVERY == 0:
                store.leases.forget_ended()
