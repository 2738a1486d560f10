"""Verifications: finished jobs that are replayed and re-simulated to check every figure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

from pydantic import with_config
from sqlalchemy import ColumnElement, Connection, any_, func, or_, select, update
from sqlalchemy.dialects.postgresql import insert

from buildarena_backend import events
from buildarena_backend.database.database import Database
from buildarena_backend.database.rows import bound_texts, columns_of, known, value_of
from buildarena_backend.database.tables import verifications
from buildarena_backend.ids import new_id
from buildarena_backend.results.audits import note_verdict
from buildarena_backend.states import Verdict, VerificationState

ABANDONED_AFTER = timedelta(minutes=10)
"""Time after which another worker repeats an unfinished verification: it writes no score."""
MAX_OPEN = 200
"""Verifications that one owner may have waiting or running."""
OWNER_LOCK = 0x766572  # "ver"
QUEUED = VerificationState.QUEUED


@with_config(use_attribute_docstrings=True, revalidate_instances="always")
@dataclass(frozen=True, slots=True, kw_only=True)
class Verification:
    """A check of one job."""

    id: str
    job_id: str
    state: VerificationState
    verdict: Verdict | None
    """null until it is done; a refuted job counts nowhere, and nothing follows from an inconclusive
    verification."""
    report: dict[str, Any] | None
    """ok, verdict, and checks with name, ok, kept and found; null until it is done."""
    created_at: datetime
    finished_at: datetime | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Admission:
    """Result of a request for verifications.

    Attributes:
        ids: Ids of open verifications, by job.
        left: Jobs that were not added, as the owner has the maximum of open ones.
    """

    ids: Mapping[str, str]
    left: Sequence[str]
    added: int


class Verifications:
    """Requests, claims and ends verifications."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def request(self, job_ids: Sequence[str], *, owner: str | None = None) -> Admission:
        """Request verifications of jobs, as many as the owner may have open at once.

        A job whose verification is open already is not verified twice: the caller gets that one.

        Args:
            job_ids: The jobs, in the order in which they find room.
            owner: The key that requests them; None for the operator.
        """
        with self._database.transaction() as connection:
            # Two requests of one owner must not both find the last places free.
            lock = func.pg_advisory_xact_lock(OWNER_LOCK, func.hashtext(owner or ""))
            connection.execute(select(lock))
            open_ids = self._open_ones(job_ids, connection)
            mine = verifications.c.owner.is_not_distinct_from(owner) & _OPEN
            count = select(func.count()).where(mine)
            room = max(0, MAX_OPEN - connection.execute(count).scalar_one())
            fresh = [job_id for job_id in dict.fromkeys(job_ids) if job_id not in open_ids]
            if fresh[:room]:
                rows = [
                    {"id": new_id("check"), "job_id": id_, "owner": owner, "state": QUEUED}
                    for id_ in fresh[:room]
                ]
                # Another owner may request the same at this moment.
                connection.execute(insert(verifications).on_conflict_do_nothing(), rows)
                open_ids = self._open_ones(job_ids, connection)
        ids = {job_id: open_ids[job_id] for job_id in dict.fromkeys(job_ids) if job_id in open_ids}
        return Admission(
            ids=ids,
            left=tuple(job_id for job_id in fresh[room:] if job_id not in ids),
            added=len(fresh[:room]),
        )

    @staticmethod
    def _open_ones(job_ids: Sequence[str], connection: Connection) -> dict[str, str]:
        """Return the ids of open verifications, by job."""
        query = select(verifications.c.job_id, verifications.c.id).where(
            verifications.c.job_id == any_(bound_texts(job_ids)), _OPEN
        )
        return {row.job_id: row.id for row in connection.execute(query)}

    def claim_next(self) -> Verification | None:
        """Take the verification that waits longest, or one that was abandoned."""
        waiting = (
            select(verifications.c.id)
            .where(_claimable())
            .order_by(verifications.c.created_at)
            .limit(1)
            .with_for_update(skip_locked=True)
        )
        row = self._database.first_row(
            update(verifications)
            .where(verifications.c.id == waiting.scalar_subquery())
            .values(state=VerificationState.RUNNING, claimed_at=events.now)
            .returning(*_COLUMNS)
        )
        return None if row is None else value_of(Verification, row)

    def finish(
        self,
        verification_id: str,
        report: Mapping[str, Any],
        *,
        verdict: Verdict,
        refuted_trials: Sequence[int] = (),
    ) -> None:
        """Write a verification's result, and its consequences; see `audits`.

        Nothing follows from one that another worker has ended, after this one was thought dead.

        Args:
            refuted_trials: Numbers of the rollouts whose trajectories are not what they must be.
        """
        with self._database.transaction() as connection:
            job_id = connection.execute(
                update(verifications)
                .where(verifications.c.id == verification_id, _OPEN)
                .values(
                    state=VerificationState.DONE,
                    verdict=verdict,
                    report=dict(report),
                    finished_at=events.now,
                )
                .returning(verifications.c.job_id)
            ).scalar()
            if job_id is not None:
                note_verdict(
                    job_id, verdict, verification_id, refuted_trials, connection=connection
                )

    def get(self, verification_id: str) -> Verification:
        """Return the verification with this id.

        Raises:
            UnknownIdError: The verification does not exist.
        """
        query = select(*_COLUMNS).where(verifications.c.id == verification_id)
        row = known(self._database.first_row(query), "verification", verification_id)
        return value_of(Verification, row)

    def waiting(self, limit: int) -> int:
        """Return the number that wait or were abandoned, counted up to a limit."""
        some = select(verifications.c.id).where(_claimable()).limit(limit).subquery()
        return int(self._database.first_value(select(func.count()).select_from(some)))


def _claimable() -> ColumnElement[bool]:
    return or_(
        verifications.c.state == QUEUED,
        (verifications.c.state == VerificationState.RUNNING)
        & (verifications.c.claimed_at < events.now - ABANDONED_AFTER),
    )


_OPEN = verifications.c.state != VerificationState.DONE
_COLUMNS = columns_of(Verification, verifications)
