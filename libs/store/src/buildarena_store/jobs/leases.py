"""Leases: who may work on a job, and the writes that only the holder may make.

Every claim raises the job's fencing token. A write names its token; when the job has a newer
one, or is no longer running, nothing is written and StaleLeaseError is raised. All times are
the database's, so a worker with a wrong clock does no harm.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import timedelta
from typing import Any

from sqlalchemy import (
    Boolean,
    ColumnElement,
    Connection,
    case,
    column,
    literal,
    select,
    text,
    tuple_,
    update,
)

from buildarena_store import events
from buildarena_store.accounts.reservations import release
from buildarena_store.database import Database
from buildarena_store.errors import StaleLeaseError
from buildarena_store.jobs.jobs import JOB_COLUMNS, Job, job_from_row
from buildarena_store.tables import attempts, budgets, jobs

RENUDGE_AFTER = timedelta(seconds=10)
"""A queued job whose message may have been lost is announced again after this time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Lease:
    """The right to work on a job.

    Attributes:
        job: The job as it was when claimed.
        owner: The worker's id.
        token: The fencing token that goes with every write.
        budgeted: Whether a budget paid for the job when it was claimed.
    """

    job: Job
    owner: str
    token: int
    budgeted: bool = False

    @property
    def first(self) -> bool:
        """Whether nobody held the job before, so that it has neither journal nor rollouts."""
        return self.token == 1


# One statement each, because every stage of every job waits for them.
_WAITS = "state = 'queued' AND queue = :queue AND available_at <= clock_timestamp()"
_CLAIM = text(
    f"""
    WITH taken AS (
        UPDATE jobs SET
            state = 'running',
            lease_owner = :owner,
            lease_token = lease_token + 1,
            lease_expires_at = clock_timestamp() + :duration,
            started_at = COALESCE(started_at, clock_timestamp())
        WHERE id = COALESCE(
            (SELECT id FROM jobs WHERE {_WAITS} AND faults > 0
             ORDER BY created_at, id LIMIT 1 FOR UPDATE SKIP LOCKED),
            (SELECT id FROM jobs WHERE {_WAITS} AND id = CAST(:hint AS text)
             FOR UPDATE SKIP LOCKED),
            (SELECT id FROM jobs WHERE {_WAITS}
             ORDER BY created_at, id LIMIT 1 FOR UPDATE SKIP LOCKED)
        )
        RETURNING *
    ), held AS (
        INSERT INTO attempts (job_id, token, stage, worker)
        SELECT id, lease_token, stage, lease_owner FROM taken
    ), told AS (
        INSERT INTO events (job_id, kind, data)
        SELECT id, 'running', jsonb_build_object('stage', stage, 'worker', lease_owner) FROM taken
    )
    SELECT {", ".join(column.name for column in JOB_COLUMNS)},
        EXISTS (SELECT 1 FROM budgets WHERE budgets.id IN (payer, owner)) AS budgeted
    FROM taken
    """  # noqa: S608 - made of our own column names
).columns(*JOB_COLUMNS, column("budgeted", Boolean))
_END_HOLD = text(
    """
    WITH released AS (
        DELETE FROM reservations WHERE job_id = :job_id
    ), ended AS (
        UPDATE attempts SET ended_at = clock_timestamp(), result = :result, detail = :note
        WHERE job_id = :job_id AND token = :token
    )
    INSERT INTO events (job_id, kind, data) VALUES (:job_id, :kind, CAST(:data AS jsonb))
    """
)


class Leases:
    """Claims, renews, hands over and ends leases.

    Args:
        database: Where the jobs are.
        duration_s: How long a lease lasts without a heartbeat.
        max_faults: Infrastructure faults without progress after which a job is given up.
    """

    def __init__(
        self, database: Database, *, duration_s: float = 15.0, max_faults: int = 8
    ) -> None:
        self._database = database
        self.duration = timedelta(seconds=duration_s)
        self._max_faults = max_faults

    def claim(self, queue: str, *, owner: str, hint: str | None = None) -> Lease | None:
        """Takes a waiting job of a queue: a recovered one first, then the hinted, then the oldest.

        Args:
            queue: Queue name.
            owner: The worker's id.
            hint: The job that a message named.

        Returns:
            The lease, or None when nothing waits.
        """
        given = {"queue": queue, "owner": owner, "hint": hint, "duration": self.duration}
        with self._database.statement() as connection:
            row = connection.execute(_CLAIM, given).first()
        if row is None:
            return None
        job = job_from_row(row)
        return Lease(job=job, owner=owner, token=job.lease_token, budgeted=row.budgeted)

    def heartbeat(self, leases: Sequence[Lease]) -> dict[str, bool]:
        """Renews leases.

        Returns:
            Ids of the jobs whose lease is still ours, each with whether a budget pays for the
            job now; work on the others must stop.
        """
        if not leases:
            return {}
        pairs = [(lease.job.id, lease.token) for lease in leases]
        paying = select(budgets).where(budgets.c.id.in_([jobs.c.payer, jobs.c.owner]))
        with self._database.statement() as connection:
            rows = connection.execute(
                update(jobs)
                .where(jobs.c.state == "running", tuple_(jobs.c.id, jobs.c.lease_token).in_(pairs))
                .values(lease_expires_at=events.now + self.duration)
                .returning(jobs.c.id, paying.exists().label("budgeted"))
            )
            return {row.id: row.budgeted for row in rows}

    def advance(
        self,
        lease: Lease,
        *,
        connection: Connection,
        result: str = "done",
        note: str | None = None,
        **values: Any,
    ) -> None:
        """Ends the lease and writes the job's next place, both or neither.

        Args:
            lease: The lease that ends.
            connection: The transaction that also holds what belongs to this step.
            result: How this hold ended: ``done``, ``fault``, ``handed_back``.
            note: A sentence for people, kept with the attempt.
            values: The job's columns to set, ``state`` among them.

        Raises:
            StaleLeaseError: The lease is over; the transaction must be undone.
        """
        changed = connection.execute(
            update(jobs)
            .where(*_held(lease))
            .values(lease_owner=None, lease_expires_at=None, **values)
        )
        if changed.rowcount != 1:
            raise StaleLeaseError(lease.job.id, lease.token)
        shown = {name: values[name] for name in ("stage", "outcome", "reason") if values.get(name)}
        ended = {
            "job_id": lease.job.id,
            "token": lease.token,
            "result": result,
            "note": note,
            "kind": str(values["state"]),
            "data": json.dumps(shown),
        }
        connection.execute(_END_HOLD, ended)

    def queue_again(
        self, lease: Lease, *, stage: str, queue: str, connection: Connection, **values: Any
    ) -> None:
        """Passes the job on to a stage, there to be claimed afresh; faults are forgiven."""
        self.advance(
            lease,
            connection=connection,
            state="queued",
            stage=stage,
            queue=queue,
            faults=0,
            nudged_at=None,
            available_at=events.now,
            **values,
        )

    def hand_back(self, lease: Lease) -> None:
        """Gives up the work without fault, for example when a worker shuts down."""
        with self._database.transaction() as connection:
            self.advance(
                lease, connection=connection, result="handed_back", state="queued", nudged_at=None
            )

    def fault(self, lease: Lease, detail: str, *, delay_s: float = 0.0, reason: str) -> bool:
        """Records an infrastructure fault: the job waits for another attempt, or is given up.

        Args:
            lease: The lease that ends.
            detail: What happened, for people.
            delay_s: How long the job waits before it may be claimed again.
            reason: The class of the fault, for the dead-letter view.

        Returns:
            True when the job will be tried again.
        """
        with self._database.transaction() as connection:
            met = select(jobs.c.faults).where(jobs.c.id == lease.job.id)
            faults = int(connection.execute(met).scalar_one()) + 1
            again = faults < self._max_faults
            if again:
                self.advance(
                    lease,
                    connection=connection,
                    result="fault",
                    note=detail,
                    state="queued",
                    faults=faults,
                    nudged_at=None,
                    available_at=events.now + timedelta(seconds=delay_s),
                    detail=detail,
                )
            else:
                self.give_up(lease, detail, reason=reason, connection=connection)
        return again

    def give_up(self, lease: Lease, detail: str, *, reason: str, connection: Connection) -> None:
        """Ends the job as errored: outside every average, and kept in the dead-letter view."""
        self.advance(
            lease,
            connection=connection,
            result="fault",
            note=detail,
            state="done",
            outcome="errored",
            reason=reason,
            faults=jobs.c.faults + 1,
            finished_at=events.now,
            detail=detail,
        )

    def recover(self) -> list[str]:
        """Re-queues jobs whose lease ran out, and gives up those that keep losing their workers.

        Returns:
            Ids of the jobs that wait again.
        """
        last = jobs.c.faults + 1 >= self._max_faults
        with self._database.transaction() as connection:
            lost = (
                select(jobs.c.id)
                .where(jobs.c.state == "running", jobs.c.lease_expires_at < events.now)
                .with_for_update(skip_locked=True)
            )
            rows = connection.execute(
                update(jobs)
                .where(jobs.c.id.in_(lost.scalar_subquery()))
                .values(
                    state=case((last, "done"), else_="queued"),
                    outcome=case((last, literal("errored")), else_=None),
                    reason=case((last, literal("lost_worker")), else_=None),
                    detail=case(
                        (last, literal("its workers were lost again and again")), else_=None
                    ),
                    finished_at=case((last, events.now), else_=None),
                    faults=jobs.c.faults + 1,
                    lease_owner=None,
                    lease_expires_at=None,
                    nudged_at=None,
                    available_at=events.now,
                )
                .returning(jobs.c.id, jobs.c.state, jobs.c.lease_token, jobs.c.stage)
            ).all()
            release([row.id for row in rows], connection=connection)
            for row in rows:
                _end_attempt(connection, row.id, row.lease_token, "lost", "no heartbeat came")
                shown: Mapping[str, str] = {"stage": row.stage, "why": "lost worker"}
                events.record_jobs(connection, [row.id], row.state, shown)
        return [row.id for row in rows if row.state == "queued"]

    def to_announce(self, queue: str, limit: int) -> list[str]:
        """Waiting jobs that no message speaks of, oldest first; they are marked as announced."""
        with self._database.transaction() as connection:
            silent = (
                select(jobs.c.id)
                .where(
                    jobs.c.state == "queued",
                    jobs.c.queue == queue,
                    jobs.c.available_at <= events.now,
                    jobs.c.nudged_at.is_(None) | (jobs.c.nudged_at < events.now - RENUDGE_AFTER),
                )
                .order_by((jobs.c.faults > 0).desc(), jobs.c.created_at, jobs.c.id)
                .limit(limit)
                .with_for_update(skip_locked=True)
            )
            rows = connection.execute(
                update(jobs)
                .where(jobs.c.id.in_(silent.scalar_subquery()))
                .values(nudged_at=events.now)
                .returning(jobs.c.id)
            )
            return [row.id for row in rows]


def _held(lease: Lease) -> tuple[ColumnElement[bool], ...]:
    return (
        jobs.c.id == lease.job.id,
        jobs.c.lease_token == lease.token,
        jobs.c.state == "running",
    )


def _end_attempt(
    connection: Connection, job_id: str, token: int, result: str, detail: str | None
) -> None:
    connection.execute(
        update(attempts)
        .where(attempts.c.job_id == job_id, attempts.c.token == token)
        .values(ended_at=events.now, result=result, detail=detail)
    )
