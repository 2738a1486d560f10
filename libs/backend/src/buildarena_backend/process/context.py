"""Connections of a process: the store, the artifacts, the queues and the tasks."""

from __future__ import annotations

from dataclasses import dataclass

from buildarena_backend.artifacts.store import ArtifactStore
from buildarena_backend.catalog.tasks import TaskCatalog
from buildarena_backend.database.database import Database
from buildarena_backend.queue.queues import Queues
from buildarena_backend.settings import Settings
from buildarena_backend.store import Store


@dataclass(frozen=True, slots=True, kw_only=True)
class Context:
    """A process' connections; each component gets those that it uses."""

    settings: Settings
    store: Store
    artifacts: ArtifactStore
    queues: Queues
    tasks: TaskCatalog

    def close(self) -> None:
        """Close the connections."""
        self.queues.close()
        self.store.database.close()


def open_context(
    settings: Settings,
    *,
    pool_size: int = 5,
    pool_timeout_s: float = 30.0,
    overflow: int | None = None,
    name: str = "buildarena",
) -> Context:
    """Open the settings' connections; nothing is contacted before it is used.

    The connections to the database are those of `Database`.
    """
    database = Database(
        settings.required_database_url(),
        pool_size=settings.database_connections or pool_size,
        pool_timeout_s=pool_timeout_s,
        overflow=overflow,
        name=name,
    )
    store = Store(database, lease_s=settings.lease_s, max_faults=settings.max_faults)
    return Context(
        settings=settings,
        store=store,
        artifacts=ArtifactStore(settings.artifacts_location, settings.artifact_options),
        queues=Queues(settings.required_broker_url()),
        tasks=TaskCatalog(store.tasks),
    )
