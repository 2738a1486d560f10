"""The store of one database: everything that is read from and written to it."""

from __future__ import annotations

from dataclasses import dataclass

from buildarena_backend.accounts.budgets import Budgets
from buildarena_backend.accounts.keys import ApiKeys
from buildarena_backend.catalog.stored_tasks import Tasks
from buildarena_backend.database.database import Database
from buildarena_backend.events import Events
from buildarena_backend.jobs.jobs import Jobs
from buildarena_backend.journal.external_calls import ExternalCalls
from buildarena_backend.journal.journal import Journal
from buildarena_backend.journal.rollouts import Rollouts
from buildarena_backend.journal.turns import Turns
from buildarena_backend.leases.leases import Leases
from buildarena_backend.leases.runner_leases import RunnerLeases
from buildarena_backend.leases.waiting import WaitingJobs
from buildarena_backend.results.results import Results
from buildarena_backend.results.verifications import Verifications
from buildarena_backend.sweeps.lifecycle import SweepLifecycle
from buildarena_backend.sweeps.sweeps import Sweeps
from buildarena_backend.telemetry.metrics import Metrics
from buildarena_backend.workers import Workers


@dataclass(frozen=True, slots=True, kw_only=True)
class Store:
    """The repositories of one database; several written in one transaction change together."""

    database: Database
    jobs: Jobs
    leases: Leases
    waiting: WaitingJobs
    runner_leases: RunnerLeases
    journal: Journal
    rollouts: Rollouts
    results: Results
    external_calls: ExternalCalls
    turns: Turns
    verifications: Verifications
    sweeps: Sweeps
    lifecycle: SweepLifecycle
    keys: ApiKeys
    budgets: Budgets
    tasks: Tasks
    events: Events
    workers: Workers
    metrics: Metrics


def open_store(database: Database, *, lease_s: float, max_faults: int) -> Store:
    """The repositories of a database.

    Args:
        database: The database.
        lease_s: Seconds that a lease is valid without a heartbeat.
        max_faults: Infrastructure faults without progress after which a job is given up.
    """
    leases = Leases(database, duration_s=lease_s, max_faults=max_faults)
    return Store(
        database=database,
        jobs=Jobs(database),
        leases=leases,
        waiting=WaitingJobs(database),
        runner_leases=RunnerLeases(database, leases),
        journal=Journal(database),
        rollouts=Rollouts(database),
        results=Results(database, leases),
        external_calls=ExternalCalls(database),
        turns=Turns(database),
        verifications=Verifications(database),
        sweeps=Sweeps(database),
        lifecycle=SweepLifecycle(database),
        keys=ApiKeys(database),
        budgets=Budgets(database),
        tasks=Tasks(database),
        events=Events(database),
        workers=Workers(database),
        metrics=Metrics(database),
    )
