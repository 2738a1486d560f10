"""The store of one database: everything that is read from and written to it."""

from __future__ import annotations

from sqlalchemy import Text, literal_column, or_, select

from buildarena_backend.accounts.budgets import Budgets
from buildarena_backend.accounts.keys import ApiKeys
from buildarena_backend.catalog.tasks import Tasks
from buildarena_backend.database.database import Database
from buildarena_backend.database.tables import jobs
from buildarena_backend.events import Events
from buildarena_backend.jobs.jobs import Jobs
from buildarena_backend.journal.external_calls import ExternalCalls
from buildarena_backend.journal.journal import Journal
from buildarena_backend.journal.rollouts import Rollouts
from buildarena_backend.journal.turns import Turns
from buildarena_backend.leases.claiming import WAITING_QUEUES
from buildarena_backend.leases.leases import Leases
from buildarena_backend.leases.lost_leases import ANY_LOST
from buildarena_backend.leases.runner_leases import RunnerLeases
from buildarena_backend.results.results import Results
from buildarena_backend.results.verifications import Verifications
from buildarena_backend.states import JobState
from buildarena_backend.sweeps.lifecycle import SweepLifecycle
from buildarena_backend.sweeps.sweeps import Sweeps
from buildarena_backend.telemetry.metrics import Metrics
from buildarena_backend.workers import Workers

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
    """Jobs that wait in queues, for the wake-up of workers."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def queues(self, limit: int) -> dict[str, int]:
        """Return the queues that jobs wait in now, with the numbers, counted up to a limit."""
        rows = self._database.all_rows(WAITING_QUEUES, {"most": limit})
        return {row.name: row.jobs for row in rows if row.jobs}

    def is_quiet(self) -> bool:
        """Return whether no job waits and no lease expired, by one statement."""
        return not self._database.first_value(select(or_(ANY_LOST, _ANY_WAITING)))


class Store:
    """The repositories of one database; several written in one transaction change together.

    Args:
        lease_s: Seconds that a lease is valid without a heartbeat.
        max_faults: Infrastructure faults without progress after which a job is given up.
    """

    def __init__(self, database: Database, *, lease_s: float, max_faults: int) -> None:
        self.database = database
        self.jobs = Jobs(database)
        self.leases = Leases(database, duration_s=lease_s, max_faults=max_faults)
        self.waiting = WaitingJobs(database)
        self.runner_leases = RunnerLeases(database, self.leases)
        self.journal = Journal(database)
        self.rollouts = Rollouts(database)
        self.results = Results(database, self.leases)
        self.external_calls = ExternalCalls(database)
        self.turns = Turns(database)
        self.verifications = Verifications(database)
        self.sweeps = Sweeps(database)
        self.lifecycle = SweepLifecycle(database)
        self.keys = ApiKeys(database)
        self.budgets = Budgets(database)
        self.tasks = Tasks(database)
        self.events = Events(database)
        self.workers = Workers(database)
        self.metrics = Metrics(database)
