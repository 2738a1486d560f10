"""One process' connections: the database with its repositories, the artifacts, the queues."""

from __future__ import annotations

from dataclasses import dataclass

from buildarena_pipeline.broker.queues import Queues
from buildarena_pipeline.catalog.tasks import TaskCatalogue
from buildarena_pipeline.runtime.settings import Settings
from buildarena_store import (
    ApiKeys,
    ArtifactStore,
    Budgets,
    Database,
    Events,
    ExternalCalls,
    Figures,
    Jobs,
    Journal,
    Leases,
    Results,
    Rollouts,
    Sweeps,
    Tasks,
    Verifications,
    Workers,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Context:
    """Everything that stages, sweeper and API share."""

    settings: Settings
    database: Database
    artifacts: ArtifactStore
    queues: Queues
    jobs: Jobs
    sweeps: Sweeps
    leases: Leases
    journal: Journal
    rollouts: Rollouts
    results: Results
    events: Events
    workers: Workers
    verifications: Verifications
    external: ExternalCalls
    keys: ApiKeys
    budgets: Budgets
    figures: Figures
    tasks: Tasks
    catalogue: TaskCatalogue

    def close(self) -> None:
        """Closes the connections."""
        self.queues.close()
        self.database.close()


def open_context(settings: Settings, *, pool_size: int = 5) -> Context:
    """Connects to what the settings name; nothing is contacted before it is used."""
    database = Database(settings.required_database_url(), pool_size=pool_size)
    tasks = Tasks(database)
    leases = Leases(database, duration_s=settings.lease_s, max_faults=settings.max_faults)
    return Context(
        settings=settings,
        database=database,
        artifacts=ArtifactStore(settings.artifacts_location),
        queues=Queues(settings.required_broker_url()),
        jobs=Jobs(database),
        sweeps=Sweeps(database),
        leases=leases,
        journal=Journal(database),
        rollouts=Rollouts(database),
        results=Results(database, leases),
        events=Events(database),
        workers=Workers(database),
        verifications=Verifications(database),
        external=ExternalCalls(database),
        keys=ApiKeys(database),
        budgets=Budgets(database),
        figures=Figures(database),
        tasks=tasks,
        catalogue=TaskCatalogue(tasks),
    )
