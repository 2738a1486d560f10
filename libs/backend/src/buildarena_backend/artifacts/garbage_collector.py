"""Garbage collection: artifacts that nothing refers to go to the trash, and later for good.

A writer stores bytes before the row that refers to them is committed, and equal bytes may be stored
again at any moment. So only what has lain for days is garbage, it is moved before it is deleted,
and bytes that are referred to again are taken back: at once, and at every collection.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from typing import Final

from sqlalchemy import Connection, select, text, union

from buildarena_backend.artifacts.store import ArtifactStore, StoredArtifact
from buildarena_backend.database.database import Database
from buildarena_backend.database.tables import job_artifacts, rollouts

LOCK: Final = 0x67617262  # "garb"
"""A collection holds it alone, backups hold it together: what a backup copies stays."""
BATCH: Final = 1000
PREFIXES: Final = tuple(f"{number:02x}" for number in range(256))
"""Parts of the store that are processed one after the other, to bound memory."""
KEPT: Final = timedelta(days=7)
"""Longer than any transaction, any upload and any weekend."""
REFERENCES: Final = (
    job_artifacts.c.hash,
    rollouts.c.machine_hash,
    rollouts.c.trajectory_hash,
)
"""The columns that refer to artifacts."""


@dataclass(slots=True, kw_only=True)
class Collection:
    """Result of a garbage collection, or of its dry run.

    Attributes:
        in_use: Artifacts that something refers to.
        young: Artifacts that nothing refers to, too new to be garbage.
        trashed: Artifacts that went to the trash.
        trashed_bytes: Their lengths together.
        deleted: Artifacts that were deleted from the trash.
        deleted_bytes: Their lengths together.
        taken_back: Artifacts that came out of the trash, as something refers to them.
    """

    in_use: int = field(default=0)
    young: int = field(default=0)
    trashed: int = field(default=0)
    trashed_bytes: int = field(default=0)
    deleted: int = field(default=0)
    deleted_bytes: int = field(default=0)
    taken_back: int = field(default=0)


def referenced(connection: Connection, prefix: str = "") -> Iterator[str]:
    """Return the hashes of all artifacts that something refers to, in their order.

    Args:
        prefix: Only hashes that begin so.
    """
    parts = [
        select(column.label("hash")).where(column.is_not(None), column.startswith(prefix))
        for column in REFERENCES
    ]
    # For this query alone: later queries of the connection are not worth a cursor.
    query = union(*parts).order_by("hash").execution_options(yield_per=BATCH)
    for row in connection.execute(query):
        yield row.hash


class GarbageCollector:
    """Finds and removes unreferenced artifacts.

    Args:
        keep: Time for which an unreferenced artifact stays, and again in the trash.
    """

    def __init__(self, database: Database, store: ArtifactStore, *, keep: timedelta = KEPT) -> None:
        self._database = database
        self._store = store
        self._keep = keep

    def collect(self, *, dry_run: bool = False) -> Collection | None:
        """Collect once.

        Args:
            dry_run: Only report what would be done.

        Returns:
            What was done; None while another collection or a backup is under way.

        Raises:
            ArtifactStoreError: The store failed; the next collection continues from there.
        """
        with self._database.engine.connect() as connection:
            lock = {"key": LOCK}
            held = connection.execute(text("SELECT pg_try_advisory_lock(:key)"), lock).scalar_one()
            connection.rollback()
            if not held:
                return None
            try:
                done = Collection()
                oldest = datetime.now(UTC) - self._keep
                for prefix in PREFIXES:
                    self._collect(prefix, oldest, done, dry_run=dry_run)
            finally:
                connection.rollback()
                connection.execute(text("SELECT pg_advisory_unlock(:key)"), lock)
                connection.rollback()
        return done

    def _collect(self, prefix: str, oldest: datetime, done: Collection, *, dry_run: bool) -> None:
        references = self._references(prefix)
        for item in self._store.all(prefix, trashed=True):
            if item.hash in references:
                done.taken_back += 1
                if not dry_run:
                    self._store.restore(item.hash)
            elif item.stored_at < oldest:
                done.deleted += 1
                done.deleted_bytes += item.size
                if not dry_run:
                    self._store.delete_trashed(item.hash)
        garbage = []
        for item in self._store.all(prefix):
            if item.hash in references:
                done.in_use += 1
            elif item.stored_at < oldest:
                garbage.append(item)
            else:
                done.young += 1
        if garbage and not dry_run:
            garbage = self._trash(prefix, garbage)
        done.trashed += len(garbage)
        done.trashed_bytes += sum(item.size for item in garbage)

    def _trash(self, prefix: str, garbage: Sequence[StoredArtifact]) -> list[StoredArtifact]:
        for item in garbage:
            self._store.trash(item.hash)
        # Equal bytes may have been stored and referred to since we looked.
        references = self._references(prefix)
        for item in garbage:
            if item.hash in references:
                self._store.restore(item.hash)
        return [item for item in garbage if item.hash not in references]

    def _references(self, prefix: str) -> set[str]:
        with self._database.transaction() as connection:
            return set(referenced(connection, prefix))
