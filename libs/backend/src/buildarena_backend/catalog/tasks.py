"""All tasks that can be named: the built-in ones and those that users uploaded.

New submissions get a task's newest version; a job keeps the version it was submitted for, to its
end and for every verification after it.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import structlog
from sqlalchemy import Select, select, tuple_
from sqlalchemy.dialects.postgresql import distinct_on, insert

from buildarena_backend.accounts.names import claim_name
from buildarena_backend.database.database import Database
from buildarena_backend.database.rows import columns_of, value_of
from buildarena_backend.database.tables import tasks
from buildarena_backend.errors import RefusedError, UnknownIdError
from buildarena_benchmark import Task, TaskError, builtin_tasks, parse_task

TaskKey = tuple[str, str]
"""Name and version."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredTask:
    """A version of an uploaded task, without its text.

    Attributes:
        version: Hash of all that can change a score.
        owner: Id of the API key that uploaded it, if any.
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
        """Store a version with its YAML text, unless it exists.

        Args:
            name: The task's name, which is the owner's from now on.
            version: Hash of all that can change a score.
            owner: Id of the API key that uploads it; None for the operator.
            force: Add a version to another key's task, as an admin may.

        Returns:
            Whether it is new.

        Raises:
            RefusedError: The name is another key's.
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
        """Return the newest version of each task, by name.

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
        """Return all versions of a task, the newest first."""
        query = select(*_COLUMNS).where(tasks.c.name == name)
        return self._read(query.order_by(tasks.c.created_at.desc(), tasks.c.version))

    def documents(self, keys: Collection[TaskKey]) -> Mapping[TaskKey, str]:
        """Return the YAML texts of those of the versions that were uploaded."""
        query = select(tasks.c.name, tasks.c.version, tasks.c.document).where(
            tuple_(tasks.c.name, tasks.c.version).in_(keys)
        )
        return {(row.name, row.version): row.document for row in self._database.all_rows(query)}

    def _read(self, query: Select[Any]) -> list[StoredTask]:
        return [value_of(StoredTask, row) for row in self._database.all_rows(query)]


_COLUMNS = columns_of(StoredTask, tasks)


log = structlog.get_logger(__name__)

MAX_PARSED = 2000
"""Parsed tasks in memory at most; each is a few kilobytes, at worst a hundred."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CatalogueEntry:
    """A version of a task, and where it is from.

    Attributes:
        custom: Whether it was uploaded.
        current: Whether new submissions get this version.
        owner: Id of the API key that uploaded it, if any.
        created_at: None for built-in tasks.
    """

    task: Task
    custom: bool = False
    current: bool = True
    owner: str | None = None
    created_at: datetime | None = None


class TaskCatalog:
    """Finds tasks. One serves a whole process, from any thread.

    A version's text never changes, so each is read and parsed once a process.
    """

    def __init__(self, tasks: Tasks) -> None:
        self._tasks = tasks
        self._parsed: dict[TaskKey, Task | None] = {}

    def newest(self) -> Mapping[str, Task]:
        """Return every task by name, the built-in ones first, each in its newest version."""
        return {entry.task.name: entry.task for entry in self.entries()}

    def entries(self) -> Sequence[CatalogueEntry]:
        """Return the same as `newest`, with the origin of each."""
        builtin = [CatalogueEntry(task=task) for task in builtin_tasks().values()]
        return [*builtin, *self._entries(self._tasks.newest())]

    def select(self, names: Collection[str]) -> Mapping[str, Task]:
        """Return the newest versions of those of the names that exist.

        The database is queried only when a name is not a built-in task's.
        """
        builtin = builtin_tasks()
        tasks = {name: builtin[name] for name in names if name in builtin}
        custom_names = {name for name in names if name not in builtin}
        if custom_names:
            entries = self._entries(self._tasks.newest(custom_names))
            tasks |= {entry.task.name: entry.task for entry in entries}
        return tasks

    def exact(self, name: str, version: str) -> Task | None:
        """Return this version, or None if it does not exist or its scoring has changed."""
        builtin = builtin_tasks().get(name)
        if builtin is not None and builtin.version == version:
            return builtin
        return self._load([(name, version)])[name, version]

    def find(self, name: str, version: str | None = None) -> CatalogueEntry:
        """Return a version of a task, by default the newest.

        Raises:
            UnknownIdError: The task or the version does not exist.
        """
        builtin = builtin_tasks().get(name)
        if builtin is not None and version in {None, builtin.version}:
            return CatalogueEntry(task=builtin)
        stored = self._tasks.versions(name)
        current = builtin or next((e.task for e in self._entries(stored[:1])), None)
        if version is None and current is not None:
            version = current.version
        task = None if version is None else self.exact(name, version)
        if task is None:
            raise UnknownIdError("task", name if version is None else f"{name} version {version}")
        row = next((row for row in stored if row.version == version), stored[0])
        return CatalogueEntry(
            task=task,
            custom=True,
            current=current is not None and current.version == version,
            owner=row.owner,
            created_at=row.created_at,
        )

    def add(self, task: Task, text: str, *, owner: str | None = None, force: bool = False) -> bool:
        """Store a task, unless this version exists.

        Args:
            owner: Id of the API key that uploads it, if any.
            force: Upload a version of another key's task, as an admin may.

        Returns:
            Whether it is new.

        Raises:
            RefusedError: The name is another key's.
                The version exists with another title, category, level or indicator.
        """
        added = self._tasks.add(
            name=task.name, version=task.version, document=text, owner=owner, force=force
        )
        stored = self.exact(task.name, task.version)
        if stored is not None and stored != task:
            fields = ("title", "category", "level", "indicator")
            changed = [name for name in fields if getattr(stored, name) != getattr(task, name)]
            raise RefusedError(
                "illegal_state",
                f"version {task.version} of {task.name} exists with another "
                f"{' and '.join(changed)}, which cannot be changed alone: they stay as they were "
                "first uploaded, or choose another name",
            )
        return added

    def _entries(self, rows: Sequence[StoredTask]) -> list[CatalogueEntry]:
        """Return stored tasks as they count now, without those that can no longer be read."""
        parsed = self._load([(row.name, row.version) for row in rows])
        entries = []
        for row in rows:
            task = parsed[row.name, row.version] or self._renew(row)
            if task is not None and task.name not in builtin_tasks():
                entries.append(
                    CatalogueEntry(
                        task=task, custom=True, owner=row.owner, created_at=row.created_at
                    )
                )
        return entries

    def _renew(self, row: StoredTask) -> Task | None:
        """Return the task's text under the version that it has now.

        Scorers are part of a version: after they changed, a text is another version, which new
        submissions get, while the old one can no longer be scored as it was.
        """
        key = (row.name, row.version)
        text = self._tasks.documents([key])[key]
        task = _parse(text, row.name)
        if task is None:
            log.warning("task_unreadable", task=row.name, version=row.version)
            return None
        self._tasks.add(
            name=row.name, version=task.version, document=text, owner=row.owner, force=True
        )
        self._keep(task.name, task.version, task)
        return task

    def _load(self, keys: Sequence[TaskKey]) -> Mapping[TaskKey, Task | None]:
        """Return the tasks by key; None for those without this version."""
        parsed = self._parsed
        tasks = {key: parsed[key] for key in keys if key in parsed}
        missing = [key for key in keys if key not in tasks]
        if missing:
            texts = self._tasks.documents(missing)
            for key in missing:
                tasks[key] = None
                if key in texts:
                    task = _parse(texts[key], key[0])
                    tasks[key] = task if task and task.version == key[1] else None
                    self._keep(*key, tasks[key])
        return tasks

    def _keep(self, name: str, version: str, task: Task | None) -> None:
        if len(self._parsed) >= MAX_PARSED:
            self._parsed = {}  # a new one: other threads read the old one
        self._parsed[name, version] = task


def _parse(text: str, name: str) -> Task | None:
    """Return the task of a stored text, if it has the row's name: rows also come from archives."""
    try:
        task = parse_task(text, origin=name)
    except TaskError:
        return None
    return task if task.name == name else None
