"""Transitions: the only way to change the state of jobs that no worker has.

A lease's holder moves its job through `leases`, which checks the fencing token as well.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any, Final

from sqlalchemy import ColumnElement, Connection, update

from buildarena_backend import events
from buildarena_backend.database.tables import jobs
from buildarena_backend.states import JobState, require_legal

REOPENED: Final[Mapping[str, Any]] = {
    "outcome": None,
    "reason": None,
    "detail": None,
    "faults": 0,
    "finished_at": None,
    "available_at": events.now,
}
"""Columns of a job that had ended and is reopened."""


def transition(
    *which: ColumnElement[bool],
    to: JobState,
    allowed_from: Collection[JobState],
    connection: Connection,
    data: Mapping[str, Any] | None = None,
    **values: Any,
) -> list[str]:
    """Move jobs into a state, those that are in one that they may leave for it.

    Args:
        which: Conditions on the jobs.
        allowed_from: The states that they may leave.
        connection: The transaction it is part of.
        data: Sent to listeners with the new state.
        values: Further columns to set.

    Returns:
        Ids of the jobs that were moved.
    """
    require_legal(to, allowed_from)
    rows = connection.execute(
        update(jobs)
        .where(*which, jobs.c.state.in_(sorted(allowed_from)))
        .values(state=to, **values)
        .returning(jobs.c.id)
    )
    moved = list(rows.scalars())
    events.record_jobs(connection, moved, to, data or {})
    return moved
