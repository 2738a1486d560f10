"""What waits in queues, and which of it workers were notified of."""

from __future__ import annotations

from datetime import timedelta

from sqlalchemy import ColumnElement, Connection, Text, literal_column, or_, select, update

from buildarena_backend import events
from buildarena_backend.database.database import Database
from buildarena_backend.database.tables import jobs
from buildarena_backend.leases.claiming import WAITING_QUEUES
from buildarena_backend.leases.lost_leases import ANY_LOST
from buildarena_backend.states import JobState

NOTIFY_AGAIN_AFTER = timedelta(seconds=10)
"""Workers are notified again of a queued job whose message may have been lost."""
# The order is that of the index of waiting jobs, of which the first is enough.
_ANY_WAITING = (
    select(jobs.c.queue)
    .where(jobs.c.state == literal_column(f"'{JobState.QUEUED}'", Text))
    .order_by(jobs.c.queue)
    .limit(1)
    .scalar_subquery()
    .is_not(None)
)


class WaitingJobs:
    """Jobs that wait in queues, for whoever notifies workers of them.

    Args:
        database: Where the jobs are.
    """

    def __init__(self, database: Database) -> None:
        self._database = database

    def queues(self) -> list[str]:
        """Names of the queues that jobs wait in."""
        with self._database.statement() as connection:
            return list(connection.execute(WAITING_QUEUES).scalars())

    def is_quiet(self) -> bool:
        """Whether no job waits, and no lease ran out: one statement, for those who ask often."""
        with self._database.statement() as connection:
            return not connection.execute(select(or_(ANY_LOST, _ANY_WAITING))).scalar()

    def to_notify(self, queue: str, limit: int) -> list[str]:
        """Waiting jobs that no message names, oldest first; they are marked as notified.

        Recovered ones come before all others.
        """
        found: list[str] = []
        with self._database.transaction() as connection:
            # Each kind has an index in its order; in one query neither would serve.
            for kind in (jobs.c.faults > 0, jobs.c.faults == 0):
                found += self._notified(queue, kind, limit - len(found), connection)
        return found

    def _notified(
        self, queue: str, kind: ColumnElement[bool], limit: int, connection: Connection
    ) -> list[str]:
        unnotified = (
            select(jobs.c.id)
            .where(
                jobs.c.state == JobState.QUEUED,
                jobs.c.queue == queue,
                kind,
                jobs.c.available_at <= events.now,
                jobs.c.notified_at.is_(None)
                | (jobs.c.notified_at < events.now - NOTIFY_AGAIN_AFTER),
            )
            .order_by(jobs.c.created_at, jobs.c.id)
            .limit(limit)
            .with_for_update(skip_locked=True)
        )
        # A plain subquery may be executed once a row, and then marks more jobs than the limit.
        chosen = unnotified.cte()
        rows = connection.execute(
            update(jobs)
            .where(jobs.c.id == chosen.c.id)
            .values(notified_at=events.now)
            .returning(jobs.c.id)
        )
        return [row.id for row in rows]
