"""Reservations end with the hold under which they were made."""

from __future__ import annotations

from collections.abc import Sequence

from sqlalchemy import Connection, delete

from buildarena_store.tables import reservations


def release(job_ids: Sequence[str], *, connection: Connection) -> None:
    """Gives back what was reserved for jobs whose open request is over, or will never end."""
    if job_ids:
        connection.execute(delete(reservations).where(reservations.c.job_id.in_(job_ids)))
