"""Verifications: finished jobs that are replayed and re-simulated to check every figure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

from sqlalchemy import insert, or_, select, update

from buildarena_store import events
from buildarena_store.database import Database
from buildarena_store.errors import UnknownIdError
from buildarena_store.ids import new_id
from buildarena_store.rows import columns_of, value_of
from buildarena_store.states import VerificationState
from buildarena_store.tables import jobs, verifications

ABANDONED_AFTER = timedelta(minutes=10)
"""After so long without an end, a verification is done by another worker: it writes no score."""
NOTIFY_AGAIN_AFTER = timedelta(seconds=10)


@dataclass(frozen=True, slots=True, kw_only=True)
class Verification:
    """One check of one job.

    Attributes:
        state: A `VerificationState`.
        report: What was compared, once it is done.
    """

    id: str
    job_id: str
    state: str
    report: Mapping[str, Any] | None
    created_at: datetime
    finished_at: datetime | None


class Verifications:
    """Asks for, claims and ends verifications."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def request(self, job_id: str) -> str:
        """Asks for a job to be verified; returns the verification's id."""
        verification_id = new_id("check")
        with self._database.transaction() as connection:
            connection.execute(
                insert(verifications).values(
                    id=verification_id, job_id=job_id, state=VerificationState.QUEUED
                )
            )
        return verification_id

    def claim(self, verification_id: str) -> Verification | None:
        """Takes a verification that waits or was abandoned."""
        with self._database.transaction() as connection:
            row = connection.execute(
                update(verifications)
                .where(
                    verifications.c.id == verification_id,
                    or_(
                        verifications.c.state == VerificationState.QUEUED,
                        (verifications.c.state == VerificationState.RUNNING)
                        & (verifications.c.claimed_at < events.now - ABANDONED_AFTER),
                    ),
                )
                .values(state=VerificationState.RUNNING, claimed_at=events.now)
                .returning(*_COLUMNS)
            ).first()
        return None if row is None else value_of(Verification, row)

    def finish(self, verification_id: str, report: Mapping[str, Any]) -> None:
        """Writes what was found; an imported job whose every figure was found again counts."""
        with self._database.transaction() as connection:
            checked = connection.execute(
                update(verifications)
                .where(verifications.c.id == verification_id)
                .values(state=VerificationState.DONE, report=dict(report), finished_at=events.now)
                .returning(verifications.c.job_id)
            ).scalar()
            if report["ok"]:
                connection.execute(
                    update(jobs)
                    .where(
                        jobs.c.id == checked,
                        jobs.c.imported_from.is_not(None),
                        jobs.c.verified_at.is_(None),
                    )
                    .values(verified_at=events.now)
                )

    def get(self, verification_id: str) -> Verification:
        """The verification with this id.

        Raises:
            UnknownIdError: Nobody has it.
        """
        with self._database.transaction() as connection:
            row = connection.execute(
                select(*_COLUMNS).where(verifications.c.id == verification_id)
            ).first()
        if row is None:
            raise UnknownIdError("verification", verification_id)
        return value_of(Verification, row)

    def to_notify(self, limit: int) -> list[str]:
        """Waiting or abandoned verifications that no message names; they are marked."""
        unnotified = (
            select(verifications.c.id)
            .where(
                or_(
                    verifications.c.state == VerificationState.QUEUED,
                    (verifications.c.state == VerificationState.RUNNING)
                    & (verifications.c.claimed_at < events.now - ABANDONED_AFTER),
                ),
                verifications.c.notified_at.is_(None)
                | (verifications.c.notified_at < events.now - NOTIFY_AGAIN_AFTER),
            )
            .order_by(verifications.c.created_at)
            .limit(limit)
            .with_for_update(skip_locked=True)
        )
        with self._database.transaction() as connection:
            rows = connection.execute(
                update(verifications)
                .where(verifications.c.id.in_(unnotified.scalar_subquery()))
                .values(notified_at=events.now)
                .returning(verifications.c.id)
            )
            return [row.id for row in rows]


_COLUMNS = columns_of(Verification, verifications)
