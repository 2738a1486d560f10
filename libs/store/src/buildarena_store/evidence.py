"""Evidence of the game: files that people sent, each once, with what they were found to show."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Final

from sqlalchemy import select
from sqlalchemy.dialects.postgresql import insert

from buildarena_store.artifacts import ArtifactInfo
from buildarena_store.database import Database
from buildarena_store.evidence_tables import evidence
from buildarena_store.rows import columns_of, value_of
from buildarena_store.tables import artifacts

MAX_LISTED: Final = 200


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredEvidence:
    """One file of evidence.

    Attributes:
        hash: SHA-256 of its bytes, 64 hex digits.
        made_at: When it was packed, as it says.
        judged: What it shows, a JSON object.
        owner: Id of the API key that sent it, if any.
        created_at: When it was sent first.
    """

    hash: str
    made_at: datetime
    judged: Mapping[str, Any]
    owner: str | None
    created_at: datetime


class EvidenceFiles:
    """Adds and finds files of evidence. None is ever changed or taken away."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def add(
        self,
        stored: ArtifactInfo,
        *,
        made_at: datetime,
        judged: Mapping[str, Any],
        owner: str | None = None,
    ) -> bool:
        """Notes a file whose bytes are stored, unless it is there.

        Args:
            stored: The artifact.
            made_at: When it was packed.
            judged: What it shows.
            owner: Id of the API key that sends it; None for the operator.

        Returns:
            Whether it is new.
        """
        row = {"hash": stored.hash, "media_type": stored.media_type, "size": stored.size}
        values = {"hash": stored.hash, "made_at": made_at, "judged": judged, "owner": owner}
        statement = (
            insert(evidence).values(**values).on_conflict_do_nothing().returning(evidence.c.hash)
        )
        with self._database.transaction() as connection:
            connection.execute(insert(artifacts).values(**row).on_conflict_do_nothing())
            return connection.execute(statement).first() is not None

    def newest(self) -> list[StoredEvidence]:
        """The files that were sent last, the newest first."""
        query = select(*_COLUMNS).order_by(evidence.c.created_at.desc(), evidence.c.hash)
        with self._database.transaction() as connection:
            rows = connection.execute(query.limit(MAX_LISTED))
            return [value_of(StoredEvidence, row) for row in rows]

    def find(self, beginning: str) -> list[StoredEvidence]:
        """The files whose hash begins so, two at most."""
        query = select(*_COLUMNS).where(evidence.c.hash.startswith(beginning, autoescape=True))
        with self._database.transaction() as connection:
            return [value_of(StoredEvidence, row) for row in connection.execute(query.limit(2))]


_COLUMNS = columns_of(StoredEvidence, evidence)
