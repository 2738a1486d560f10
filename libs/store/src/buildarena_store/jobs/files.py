"""Jobs whose machine was brought as a file."""

from __future__ import annotations

from typing import Final

from sqlalchemy import Connection, func, select

from buildarena_store.states import FILE_PROVIDER, JobState
from buildarena_store.tables import jobs

OWNER_LOCK: Final = 0x66696C  # "fil"


def files_under_way(owner: str | None, *, connection: Connection) -> int:
    """How many of an owner's files wait for their trial or are in it.

    The owner's other transactions that ask wait for this one: two must not both find the last
    place free.

    Args:
        owner: Id of the API key; None for the operator.
        connection: The transaction that adds one.
    """
    lock = func.pg_advisory_xact_lock(OWNER_LOCK, func.hashtext(owner or ""))
    connection.execute(select(lock))
    mine = (
        jobs.c.owner.is_not_distinct_from(owner),
        jobs.c.state != JobState.DONE,
        jobs.c.model_config["provider"].as_string() == FILE_PROVIDER,
    )
    return connection.execute(select(func.count()).select_from(jobs).where(*mine)).scalar_one()
