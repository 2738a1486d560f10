"""Events of jobs and sweeps, in order, for progress streams."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any, Final

from sqlalchemy import Connection, cast, func, insert, literal, or_, select
from sqlalchemy.dialects.postgresql import JSONB

from buildarena_backend.database.database import Database
from buildarena_backend.database.rows import bound_texts, columns_of, value_of
from buildarena_backend.database.tables import events, sweep_jobs
from buildarena_backend.states import TURN

now = func.clock_timestamp()
"""The database's clock: workers' own clocks are never compared."""
SETTLED_AFTER: Final = timedelta(seconds=5)
"""Ids are given out before their transactions end, so an event may appear behind later ones:
readers go back this far."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """Something that happened; ids grow in the order of writing."""

    id: int
    job_id: str | None
    sweep_id: str | None
    kind: str
    data: Mapping[str, Any]
    at: datetime


def record_jobs(
    connection: Connection, job_ids: Sequence[str], kind: str, data: Mapping[str, Any]
) -> None:
    """Write one event for each job, in the transaction that made it true."""
    if job_ids:
        rows = select(
            func.unnest(bound_texts(job_ids)),
            literal(kind),
            cast(dict(data), JSONB),
        )
        connection.execute(insert(events).from_select(["job_id", "kind", "data"], rows))


def record_sweep(connection: Connection, sweep_id: str, kind: str, data: Mapping[str, Any]) -> None:
    """Write one event of a sweep."""
    connection.execute(insert(events).values(sweep_id=sweep_id, kind=kind, data=dict(data)))


class Events:
    """Reads events after a given one."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def settled(self) -> int:
        """Return an id up to which no further event will appear; 0 when nothing has happened.

        Ids are given out before their transactions end, so the newest ones are left out.
        """
        query = (
            select(events.c.id)
            .where(events.c.at < now - SETTLED_AFTER)
            .order_by(events.c.id.desc())
            .limit(1)
        )
        return int(self._database.first_value(query) or 0)

    def after(
        self,
        last_id: int,
        *,
        job_id: str | None = None,
        sweep_id: str | None = None,
        limit: int = 1000,
    ) -> list[Event]:
        """Return the events of a job, or of a sweep and its jobs, or of everything, in order.

        A sweep's have no turns: those of all its jobs are too many for one who watches it.

        Args:
            last_id: Only events with greater ids.
            job_id: Only this job's.
            sweep_id: Only this sweep's own and its jobs'.
        """
        query = select(*columns_of(Event, events)).where(events.c.id > last_id)
        if job_id is not None:
            query = query.where(events.c.job_id == job_id)
        if sweep_id is not None:
            members = select(sweep_jobs.c.job_id).where(sweep_jobs.c.sweep_id == sweep_id)
            query = query.where(
                or_(events.c.sweep_id == sweep_id, events.c.job_id.in_(members)),
                events.c.kind != TURN,
            )
        query = query.order_by(events.c.id).limit(limit)
        return [value_of(Event, row) for row in self._database.all_rows(query)]
