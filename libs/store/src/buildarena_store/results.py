"""Results: a finished job's score, written once, and the artifacts that belong to it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from sqlalchemy import Connection
from sqlalchemy.dialects.postgresql import insert

from buildarena_store import events
from buildarena_store.artifacts import ArtifactInfo
from buildarena_store.boards import Boards
from buildarena_store.database import Database
from buildarena_store.leases import Lease, Leases
from buildarena_store.tables import artifacts, job_artifacts


@dataclass(frozen=True, slots=True, kw_only=True)
class JobScore:
    """How a job ended.

    Attributes:
        outcome: ``success``, ``unsuccessful``, ``construction_failed`` or ``limit``.
        success: Whether the task's criterion was met.
        indicator: The task's performance indicator.
        metrics: Secondary metrics by name.
        flags: Remarks that keep a result out of rankings.
        reason: Class of the failure, if it failed before it was simulated.
        detail: A sentence for people.
        manifest: Versions of everything that can change the score.
    """

    outcome: str
    success: bool
    indicator: float
    metrics: Mapping[str, Any] = field(default_factory=dict)
    flags: Sequence[str] = ()
    reason: str | None = None
    detail: str | None = None
    manifest: Mapping[str, Any] = field(default_factory=dict)


class Results:
    """Writes scores.

    Attributes:
        boards: Reads scores in bulk, for leaderboards.
    """

    def __init__(self, database: Database, leases: Leases) -> None:
        self.boards = Boards(database)
        self._leases = leases

    def finish(
        self, lease: Lease, score: JobScore, *, connection: Connection, **values: Any
    ) -> None:
        """Ends a job with its score; nobody can score it again.

        Args:
            lease: The lease under which it was scored; it ends.
            score: The score.
            connection: The transaction that also ties the artifacts to the job.
            values: Further columns, for example action counts.

        Raises:
            StaleLeaseError: The lease is over; the transaction must be undone.
        """
        self._leases.advance(
            lease,
            connection=connection,
            state="done",
            outcome=score.outcome,
            reason=score.reason,
            detail=score.detail,
            success=score.success,
            indicator=score.indicator,
            metrics=dict(score.metrics),
            flags=list(score.flags),
            manifest=dict(score.manifest),
            finished_at=events.now,
            **values,
        )

    def attach(
        self, job_id: str, name: str, artifact: ArtifactInfo, *, connection: Connection
    ) -> None:
        """Ties an artifact that the artifact store holds to a job under a name."""
        connection.execute(
            insert(artifacts)
            .values(hash=artifact.hash, media_type=artifact.media_type, size=artifact.size)
            .on_conflict_do_nothing()
        )
        statement = insert(job_artifacts).values(job_id=job_id, name=name, hash=artifact.hash)
        connection.execute(
            statement.on_conflict_do_update(
                index_elements=["job_id", "name"], set_={"hash": artifact.hash}
            )
        )
