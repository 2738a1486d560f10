"""The sweeper: recovers jobs of dead workers and announces jobs that wait unheard.

Every worker process and the API run one in a thread; a lock in the database lets one at a time
do the work, so that no process is needed for it and none can be missing.
"""

from __future__ import annotations

import structlog
from sqlalchemy import text
from sqlalchemy.exc import SQLAlchemyError

from buildarena_pipeline.broker.queues import BATCH, VERIFY
from buildarena_pipeline.runtime.context import Context
from buildarena_pipeline.runtime.periodic import Periodic
from buildarena_store.tables import jobs as jobs_table

SWEEP_LOCK = 0x7377656570  # "sweep"
PERIOD_S = 1.0

log = structlog.get_logger(__name__)


class Sweeper:
    """Sweeps every second until it is stopped.

    Args:
        context: The process' connections.
        period_s: Seconds between sweeps.
    """

    def __init__(self, context: Context, *, period_s: float = PERIOD_S) -> None:
        self._context = context
        self._thread = Periodic(self._sweep_safely, name="sweeper", period_s=period_s)

    def start(self) -> None:
        """Starts the thread."""
        self._thread.start()

    def stop(self) -> None:
        """Stops the thread and waits for it."""
        self._thread.stop()

    def _sweep_safely(self) -> None:
        try:
            self.sweep()
        except SQLAlchemyError as error:
            log.warning("sweep_failed", error=str(error).splitlines()[0])
        except Exception:
            # Without a sweeper, lost messages stay lost: it must outlive what nobody foresaw.
            log.exception("sweep_failed")

    def sweep(self) -> None:
        """Sweeps once, unless another process is at it."""
        with self._context.database.engine.connect() as connection:
            lock = text("SELECT pg_try_advisory_xact_lock(:key)")
            if not connection.execute(lock, {"key": SWEEP_LOCK}).scalar_one():
                return
            recovered = self._context.leases.recover()
            if recovered:
                log.info("recovered", jobs=recovered)
            queues = connection.execute(
                jobs_table.select()
                .with_only_columns(jobs_table.c.queue)
                .where(jobs_table.c.state == "queued")
                .distinct()
            ).scalars()
            for queue in list(queues):
                announce_waiting(self._context, queue)
            self._context.external.abandon_idle()
            checks = self._context.verifications.to_announce(BATCH)
            if checks:
                self._context.queues.announce(VERIFY, checks)


def announce_waiting(context: Context, queue: str) -> None:
    """Keeps up to BATCH messages in a queue, for the jobs that no message speaks of."""
    waiting = context.queues.waiting(queue)
    if waiting is None or waiting >= BATCH:
        return
    job_ids = context.leases.to_announce(queue, BATCH - waiting)
    if job_ids:
        context.queues.announce(queue, job_ids)
