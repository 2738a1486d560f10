"""Connections of a process: the store, the artifacts, the queues and the tasks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from sqlalchemy.exc import OperationalError

from buildarena_backend.artifacts.store import ArtifactStore
from buildarena_backend.catalog.tasks import TaskCatalog
from buildarena_backend.database.database import Database
from buildarena_backend.errors import SchemaVersionError, StartupError
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


def open_context(settings: Settings, *, pool_size: int = 5, **connections: Any) -> Context:
    """Open the settings' connections; nothing is contacted before it is used.

    Args:
        connections: Further arguments of `Database`.
    """
    database = Database(
        settings.required_database_url(),
        pool_size=settings.database_connections or pool_size,
        **connections,
    )
    store = Store(database, lease_s=settings.lease_s, max_faults=settings.max_faults)
    return Context(
        settings=settings,
        store=store,
        artifacts=ArtifactStore(settings.artifacts_location, settings.artifact_options),
        queues=Queues(settings.required_broker_url()),
        tasks=TaskCatalog(store.tasks),
    )


def open_checked_context(settings: Settings, **connections: Any) -> Context:
    """Do the same as `open_context`, and see that the database answers and has our schema.

    Raises:
        StartupError: It does not, or the settings are incomplete.
    """
    try:
        context = open_context(settings, **connections)
        context.store.database.require_schema()
    except (ValueError, SchemaVersionError) as error:
        raise StartupError(str(error)) from error
    except OperationalError as error:
        raise StartupError(f"the database can't be reached: {error.orig}") from error
    return context
