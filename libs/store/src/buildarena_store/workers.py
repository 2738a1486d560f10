"""Workers: which processes serve which queues, and when they were last seen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

from sqlalchemy import ColumnElement, cast, delete, func, select
from sqlalchemy.dialects.postgresql import insert
from sqlalchemy.types import DateTime, Double

from buildarena_store import events
from buildarena_store.database import Database
from buildarena_store.rows import value_of
from buildarena_store.tables import workers

FORGOTTEN_AFTER = timedelta(hours=1)


@dataclass(frozen=True, slots=True, kw_only=True)
class WorkerInfo:
    """A worker process.

    Attributes:
        id: ``kind@host:pid``.
        kind: ``construct`` or ``simulate``.
        queues: Queues it serves.
        host: Its machine.
        pid: Its process id there.
        versions: Versions of what it runs.
        started_at: When it first reported.
        seen_at: When it last reported.
        alive: Whether it reported within the last 15 seconds, by the database's clock.
        peak_memory_bytes: The most memory it and its children ever had, if it says so.
        clock_ahead_s: How far its clock is ahead of the database's, if it says so.
    """

    id: str
    kind: str
    queues: Sequence[str]
    host: str
    pid: int
    versions: Mapping[str, Any]
    started_at: datetime
    seen_at: datetime
    alive: bool
    peak_memory_bytes: int | None
    clock_ahead_s: float | None


class Workers:
    """The register of workers."""

    def __init__(self, database: Database, *, alive_for_s: float = 15.0) -> None:
        self._database = database
        self._alive_for = timedelta(seconds=alive_for_s)

    def report(
        self,
        *,
        worker_id: str,
        kind: str,
        queues: Sequence[str],
        host: str,
        pid: int,
        versions: Mapping[str, Any],
        peak_memory_bytes: int | None = None,
        own_time: datetime | None = None,
    ) -> None:
        """Reports that a worker is alive; forgets those that have not reported for an hour."""
        row = {
            "kind": kind,
            "queues": list(queues),
            "host": host,
            "pid": pid,
            "versions": dict(versions),
            "peak_memory_bytes": peak_memory_bytes,
            "clock_ahead_s": None if own_time is None else _ahead(own_time),
        }
        statement = insert(workers).values(id=worker_id, **row)
        with self._database.transaction() as connection:
            connection.execute(
                statement.on_conflict_do_update(
                    index_elements=["id"], set_={**row, "seen_at": events.now}
                )
            )
            connection.execute(
                delete(workers).where(workers.c.seen_at < events.now - FORGOTTEN_AFTER)
            )

    def leave(self, worker_id: str) -> None:
        """Removes a worker that shuts down from the register."""
        with self._database.transaction() as connection:
            connection.execute(delete(workers).where(workers.c.id == worker_id))

    def all(self) -> list[WorkerInfo]:
        """Every known worker, the most recently seen first."""
        alive = (workers.c.seen_at > events.now - self._alive_for).label("alive")
        query = select(workers, alive).order_by(workers.c.seen_at.desc())
        with self._database.transaction() as connection:
            return [value_of(WorkerInfo, row) for row in connection.execute(query)]


def _ahead(own_time: datetime) -> ColumnElement[float]:
    """Seconds from the database's clock to a process' own."""
    difference = cast(own_time, DateTime(timezone=True)) - events.now
    return cast(func.extract("epoch", difference), Double)
