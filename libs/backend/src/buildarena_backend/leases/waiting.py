"""What waits in queues."""

from __future__ import annotations

from sqlalchemy import Text, literal_column, or_, select

from buildarena_backend.database.database import Database
from buildarena_backend.database.tables import jobs
from buildarena_backend.leases.claiming import WAITING_QUEUES
from buildarena_backend.leases.lost_leases import ANY_LOST
from buildarena_backend.states import JobState

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
    """Jobs that wait in queues, for whoever wakes workers.

    Args:
        database: Where the jobs are.
    """

    def __init__(self, database: Database) -> None:
        self._database = database

    def queues(self, most: int) -> dict[str, int]:
        """Queues that jobs wait in now, with how many, counted up to a number."""
        with self._database.statement() as connection:
            rows = connection.execute(WAITING_QUEUES, {"most": most})
            return {row.name: row.jobs for row in rows if row.jobs}

    def is_quiet(self) -> bool:
        """Whether no job waits, and no lease ran out: one statement, for those who ask often."""
        with self._database.statement() as connection:
            return not connection.execute(select(or_(ANY_LOST, _ANY_WAITING))).scalar()
