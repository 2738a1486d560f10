"""Results: a finished job's score, written once, and the artifacts that belong to it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from sqlalchemy import Connection, delete, text

from buildarena_backend import events
from buildarena_backend.artifacts.store import ArtifactInfo
from buildarena_backend.boards.ended_jobs import Boards
from buildarena_backend.database.database import Database
from buildarena_backend.database.tables import job_artifacts
from buildarena_backend.leases.leases import Lease, Leases
from buildarena_backend.results.audits import origin_of, require_audits
from buildarena_backend.states import JobState, Outcome


@dataclass(frozen=True, slots=True, kw_only=True)
class JobScore:
    """Final score of a job.

    Attributes:
        success: Share of its worlds in which the machine met the task's criterion, 0 to 1.
        indicator: The task's figure, as a mean over its worlds; 0 where it failed.
        flags: Remarks on the score; see `buildarena_benchmark.flags`.
        reason: Class of the failure, if it failed before it was simulated.
        detail: A sentence for people.
        manifest: Versions of everything that can change the score.
    """

    outcome: Outcome
    success: float
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
        """End a job with its score; it cannot be scored again.

        One with a trial of a runner's that is audited waits for its verification, which is asked
        for, before it counts.

        Args:
            lease: The lease under which it was scored; it ends.
            connection: The transaction that also ties the artifacts to the job.
            values: Further columns, for example action counts.

        Raises:
            StaleLeaseError: The lease is over; the transaction must be undone.
        """
        self._leases.advance(
            lease,
            connection=connection,
            to=JobState.DONE,
            outcome=score.outcome,
            reason=score.reason,
            detail=score.detail,
            success=score.success,
            indicator=score.indicator,
            metrics=dict(score.metrics),
            flags=list(score.flags),
            manifest=dict(score.manifest),
            finished_at=events.now,
            **{**origin_of(lease.job.id), **values},
        )
        require_audits([lease.job.id], connection=connection)

    def attach(
        self, job_id: str, files: Mapping[str, ArtifactInfo], *, connection: Connection
    ) -> None:
        """Tie artifacts that the artifact store holds to a job, by their names."""
        infos = list(files.values())
        parameters = {
            "job_id": job_id,
            "names": list(files),
            "hashes": [info.hash for info in infos],
            "types": [info.media_type for info in infos],
            "sizes": [info.size for info in infos],
        }
        connection.execute(_ATTACH, parameters)

    def replace_evidence(
        self, job_id: str, number: int, files: Mapping[str, ArtifactInfo], *, connection: Connection
    ) -> None:
        """Attach evidence of the latest fault to a job, in place of earlier evidence.

        Args:
            number: The rollout that failed; evidence of others stays.
            files: Artifacts that the artifact store holds, by their names.
        """
        earlier = rf"^[a-z]+-{number}(-[0-9-]+)?\.[a-z]+$"
        connection.execute(
            delete(job_artifacts).where(
                job_artifacts.c.job_id == job_id, job_artifacts.c.name.regexp_match(earlier)
            )
        )
        self.attach(job_id, files, connection=connection)


_ATTACH = text(
    """
    WITH given AS (
        SELECT * FROM unnest(
            CAST(:names AS text[]), CAST(:hashes AS text[]),
            CAST(:types AS text[]), CAST(:sizes AS bigint[])
        ) AS given (name, hash, media_type, size)
    ), kept AS (
        INSERT INTO artifacts (hash, media_type, size)
        SELECT DISTINCT ON (hash) hash, media_type, size FROM given ORDER BY hash
        ON CONFLICT DO NOTHING
    )
    INSERT INTO job_artifacts (job_id, name, hash) SELECT :job_id, name, hash FROM given
    ON CONFLICT (job_id, name) DO UPDATE SET hash = excluded.hash
    """
)
