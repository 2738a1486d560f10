"""Jobs whose machine is from a file."""

from __future__ import annotations

from typing import Final

from sqlalchemy import Connection, func, select

from buildarena_backend.database.tables import jobs
from buildarena_backend.errors import RefusedError
from buildarena_backend.states import FILE_PROVIDER, JobState

OWNER_LOCK: Final = 0x66696C  # "fil"
MAX_OPEN: Final = 20
"""Trials of files that one owner may have waiting or running."""


def require_room(owner: str | None, *, connection: Connection) -> None:
    """Count an owner's files that wait for their trial or are in it, after one more was added.

    It does not matter how that one came: new, opened again after it was cancelled, or tried again.
    The owner's other transactions that ask wait for this one: two must not both find the last
    place free.

    Args:
        owner: Id of the API key; None for the operator.
        connection: The transaction that added one.

    Raises:
        RefusedError: There are too many; the transaction must be undone.
    """
    lock = func.pg_advisory_xact_lock(OWNER_LOCK, func.hashtext(owner or ""))
    connection.execute(select(lock))
    mine = (
        jobs.c.owner.is_not_distinct_from(owner),
        jobs.c.state != JobState.DONE,
        jobs.c.model_config["provider"].as_string() == FILE_PROVIDER,
    )
    number = connection.execute(select(func.count()).select_from(jobs).where(*mine)).scalar_one()
    if number > MAX_OPEN:
        raise RefusedError(
            "too_many_open",
            f"{MAX_OPEN} trials of files are under way, as many as one key may have: wait for some "
            "to end",
        )
