"""Custom tasks: every version that was ever uploaded, as jobs may still need it."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import Select, select, tuple_
from sqlalchemy.dialects.postgresql import distinct_on, insert

from buildarena_backend.accounts.names import claim_name
from buildarena_backend.database.database import Database
from buildarena_backend.database.rows import columns_of, value_of
from buildarena_backend.database.tables import tasks
from buildarena_benchmark import builtin_tasks

TaskKey = tuple[str, str]
"""Name and version."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredTask:
    """One version of a task that somebody uploaded, without its text.

    Attributes:
        name: Its name.
        version: Hash of all that can change a score.
        owner: Id of the API key that uploaded it, if any.
        created_at: When it was first uploaded.
    """

    name: str
    version: str
    owner: str | None
    created_at: datetime


class Tasks:
    """Adds and finds uploaded tasks. A version never changes and is never taken away."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def add(
        self,
        *,
        name: str,
        version: str,
        document: str,
        owner: str | None = None,
        force: bool = False,
    ) -> bool:
        """Stores a version with its YAML text, unless it is there.

        Args:
            name: The task's name, which is the owner's from now on.
            version: Hash of all that can change a score.
            document: The text.
            owner: Id of the API key that uploads it; None for the operator.
            force: Add a version to another key's task, as an admin may.

        Returns:
            Whether it is new.

        Raises:
            NameTakenError: The name is another key's.
        """
        statement = (
            insert(tasks)
            .values(name=name, version=version, document=document, owner=owner)
            .on_conflict_do_nothing()
            .returning(tasks.c.version)
        )
        with self._database.transaction() as connection:
            claim_name(
                "task",
                name,
                owner=owner,
                connection=connection,
                force=force,
                reserved=builtin_tasks(),
            )
            return connection.execute(statement).first() is not None

    def newest(self, names: Collection[str] | None = None) -> list[StoredTask]:
        """The newest version of each task, by name.

        Args:
            names: Only these tasks; None for all.
        """
        query = (
            select(*_COLUMNS)
            .ext(distinct_on(tasks.c.name))
            .order_by(tasks.c.name, tasks.c.created_at.desc(), tasks.c.version)
        )
        return self._read(query if names is None else query.where(tasks.c.name.in_(names)))

    def versions(self, name: str) -> list[StoredTask]:
        """All versions of a task, the newest first."""
        query = select(*_COLUMNS).where(tasks.c.name == name)
        return self._read(query.order_by(tasks.c.created_at.desc(), tasks.c.version))

    def documents(self, keys: Collection[TaskKey]) -> Mapping[TaskKey, str]:
        """The YAML texts of these versions, as far as they were ever uploaded."""
        query = select(tasks.c.name, tasks.c.version, tasks.c.document).where(
            tuple_(tasks.c.name, tasks.c.version).in_(keys)
        )
        with self._database.transaction() as connection:
            return {(row.name, row.version): row.document for row in connection.execute(query)}

    def _read(self, query: Select[Any]) -> list[StoredTask]:
        with self._database.transaction() as connection:
            return [value_of(StoredTask, row) for row in connection.execute(query)]


_COLUMNS = columns_of(StoredTask, tasks)
