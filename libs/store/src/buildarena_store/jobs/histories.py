"""Histories: what the session of a job left in rows, packed into an artifact once it is old.

Journals, calls and events are most of what a database holds after years, and hardly anybody reads
them again. Packed, they are one artifact of their job; whoever needs them (a verification, an
export) unpacks them first, and the rows are again what they were, to the byte.
"""

from __future__ import annotations

import gzip
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import timedelta
from typing import Any, Final

from sqlalchemy import Table, any_, delete, exists, func, select, text

from buildarena_benchmark.outcomes import SCORED
from buildarena_store.artifacts import ArtifactStore
from buildarena_store.database import Database
from buildarena_store.jobs.results import attach_artifacts
from buildarena_store.rows import bound_texts
from buildarena_store.states import JobState, VerificationState
from buildarena_store.tables import (
    events,
    external_calls,
    job_artifacts,
    jobs,
    journal,
    verifications,
)

NAME: Final = "history"
"""The artifact's name among its job's."""
GZIP: Final = "application/gzip"
PACKED: Final[tuple[Table, ...]] = (journal, external_calls, events)
PAGE: Final = 500
TOGETHER: Final = 25
"""Jobs that are packed in one transaction: most of the time would go into beginning and ending."""
LEVEL: Final = 6
"""Of gzip: 9 takes twice the time for a hundredth less."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Packing:
    """What packing did.

    Attributes:
        jobs: Jobs whose histories were packed.
        rows: Rows that left their tables.
        bytes: Lengths of the artifacts together.
    """

    jobs: int
    rows: int
    bytes: int


class Histories:
    """Packs and unpacks.

    Args:
        database: Where rows are.
        store: Where artifacts are.
    """

    def __init__(self, database: Database, store: ArtifactStore) -> None:
        self._database = database
        self._store = store

    def waiting(self, older_than: timedelta) -> int:
        """How many jobs `pack_all` would pack."""
        query = select(func.count()).select_from(jobs).where(*_packable(older_than))
        with self._database.transaction() as connection:
            return int(connection.execute(query).scalar_one())

    def pack_all(self, older_than: timedelta) -> Iterator[Packing]:
        """Packs the histories of all jobs that were scored so long ago, some at a time.

        Some jobs are a transaction: broken off anywhere, nothing is lost, and the next call goes
        on. Several may pack at once. Jobs that errored keep their rows, as they may be tried again.

        Yields:
            What was done for some jobs.

        Raises:
            ArtifactStoreError: The store can't be written; these jobs' rows are untouched.
        """
        last = ""
        while True:
            query = select(jobs.c.id).where(*_packable(older_than), jobs.c.id > last)
            with self._database.transaction() as connection:
                ids = list(connection.execute(query.order_by(jobs.c.id).limit(PAGE)).scalars())
            if not ids:
                return
            for start in range(0, len(ids), TOGETHER):
                done = self._pack(ids[start : start + TOGETHER], older_than)
                if done.jobs:
                    yield done
            last = ids[-1]

    def _pack(self, job_ids: Sequence[str], older_than: timedelta) -> Packing:
        rows = size = 0
        with self._database.transaction() as connection:
            # Verified or retried meanwhile, or being packed by somebody else: left alone.
            mine = (
                select(jobs.c.id)
                .where(jobs.c.id == any_(bound_texts(job_ids)), *_packable(older_than))
                .order_by(jobs.c.id)
                .with_for_update(skip_locked=True)
            )
            ids = list(connection.execute(mine).scalars())
            # One history in memory at a time: a long session has megabytes.
            for job_id in ids:
                parts = []
                for table in PACKED:
                    found = connection.execute(_AS_JSON[table], {"job": job_id}).one()
                    parts.append(f'"{table.name}":{found.rows}')
                    rows += found.number
                packed = gzip.compress(f"{{{','.join(parts)}}}".encode(), LEVEL, mtime=0)
                kept = self._store.put(packed, GZIP)
                attach_artifacts(job_id, {NAME: kept}, connection=connection)
                size += kept.size
            for table in PACKED:
                gone = table.c.job_id == any_(bound_texts(ids))
                connection.execute(delete(table).where(gone))
        return Packing(jobs=len(ids), rows=rows, bytes=size)

    def unpack(self, job_ids: Sequence[str]) -> int:
        """Puts the rows of packed jobs back; of others nothing changes.

        Returns:
            How many jobs were packed.

        Raises:
            ArtifactMissingError: The store has lost a history; nothing of that job was changed.
            ArtifactDamagedError: It is not what was stored.
            ArtifactStoreError: The store can't be read now.
        """
        packed = select(job_artifacts.c.job_id).where(
            job_artifacts.c.name == NAME, job_artifacts.c.job_id == any_(bound_texts(job_ids))
        )
        with self._database.transaction() as connection:
            found = list(connection.execute(packed).scalars())
        return sum(self._unpack(job_id) for job_id in found)

    def _unpack(self, job_id: str) -> bool:
        own = (job_artifacts.c.job_id == job_id, job_artifacts.c.name == NAME)
        with self._database.transaction() as connection:
            # Two that unpack at once take turns, and the second finds nothing to do.
            locked = select(job_artifacts.c.hash).where(*own).with_for_update()
            digest = connection.execute(locked).scalar()
            if digest is None:
                return False
            packed = gzip.decompress(self._store.get(digest)).decode()
            for table in PACKED:
                connection.execute(_AS_ROWS[table], {"packed": packed})
            connection.execute(delete(job_artifacts).where(*own))
        return True


def _packable(older_than: timedelta) -> tuple[Any, ...]:
    """Conditions on jobs: scored, old, nothing under way, and something to pack."""
    verified = exists().where(
        verifications.c.job_id == jobs.c.id, verifications.c.state != VerificationState.DONE
    )
    return (
        jobs.c.state == JobState.DONE,
        jobs.c.outcome == any_(bound_texts(sorted(SCORED))),
        jobs.c.finished_at < func.clock_timestamp() - older_than,
        ~verified,
        exists().where(events.c.job_id == jobs.c.id),
    )


_KEYS = {table: ", ".join(column.name for column in table.primary_key) for table in PACKED}
# As `json`, and not `jsonb`: journals keep the order of keys, which replies are replayed with.
_AS_JSON = {
    table: text(
        f"SELECT COALESCE(json_agg(row_to_json(t) ORDER BY {_KEYS[table]}), '[]')::text AS rows, "  # noqa: S608 - our own tables' names
        f"count(*) AS number FROM {table.name} t WHERE job_id = :job"
    )
    for table in PACKED
}
_AS_ROWS = {
    table: text(
        f"INSERT INTO {table.name} OVERRIDING SYSTEM VALUE SELECT * FROM json_populate_recordset("  # noqa: S608 - our own tables' names
        f"NULL::{table.name}, CAST(:packed AS json)->'{table.name}')"
    )
    for table in PACKED
}
