"""Sessions of external agents: the tool calls they made, kept in order."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from datetime import timedelta
from typing import Any

from sqlalchemy import Connection, insert, select, update

from buildarena_backend import events
from buildarena_backend.database.database import Database
from buildarena_backend.database.rows import columns_of, value_of
from buildarena_backend.database.tables import external_calls, jobs
from buildarena_backend.errors import StaleLeaseError
from buildarena_backend.jobs.job import JOB_COLUMNS, Job
from buildarena_backend.jobs.transitions import transition
from buildarena_backend.leases.leases import Lease
from buildarena_backend.states import EXTERNAL_QUEUE, TURN, JobState, Outcome

IDLE_FOR = timedelta(hours=24)
"""A session that makes no call for this long is cancelled."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExternalCall:
    """A tool call.

    Attributes:
        machine: Name of the sub-structure it was meant for.
        ok: Whether the action was accepted.
        reason: Refusal class, if it was refused.
    """

    machine: str
    tool: str
    arguments: Any
    ok: bool
    reason: str | None
    feedback: str


class ExternalCalls:
    """Opens sessions of external agents and keeps their calls."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def open(self, job_id: str, *, connection: Connection) -> bool:
        """Take a job that was just added out of the queue and give it to its agent.

        Returns:
            False when the job had been there before.
        """
        opened = transition(
            jobs.c.id == job_id,
            jobs.c.lease_token == 0,
            to=JobState.RUNNING,
            allowed_from={JobState.QUEUED},
            connection=connection,
            queue=EXTERNAL_QUEUE,
            lease_owner=EXTERNAL_QUEUE,
            lease_token=1,
            started_at=events.now,
            available_at=events.now,
        )
        return bool(opened)

    def go_on(self, job_id: str, *, connection: Connection) -> None:
        """Give a session whose machine was tried back to its agent, under its own lease."""
        transition(
            jobs.c.id == job_id,
            jobs.c.queue == EXTERNAL_QUEUE,
            to=JobState.RUNNING,
            allowed_from={JobState.QUEUED},
            connection=connection,
            lease_owner=EXTERNAL_QUEUE,
            lease_token=jobs.c.lease_token + 1,
            available_at=events.now,
        )

    def lease(self, job_id: str, *, connection: Connection) -> Lease | None:
        """Return the agent's lease on its open session, locked until the transaction ends."""
        row = connection.execute(
            select(*JOB_COLUMNS)
            .where(
                jobs.c.id == job_id,
                jobs.c.state == JobState.RUNNING,
                jobs.c.queue == EXTERNAL_QUEUE,
            )
            .with_for_update()
        ).first()
        if row is None:
            return None
        job = value_of(Job, row)
        return Lease(job=job, owner=EXTERNAL_QUEUE, token=job.lease_token)

    def append(
        self, lease: Lease, sequence: int, call: ExternalCall, *, connection: Connection
    ) -> None:
        """Write a call and its counts.

        Raises:
            StaleLeaseError: The session is over.
        """
        changed = connection.execute(
            update(jobs)
            .where(jobs.c.id == lease.job.id, jobs.c.state == JobState.RUNNING)
            .values(
                actions=jobs.c.actions + 1,
                refused_actions=jobs.c.refused_actions + (0 if call.ok else 1),
                available_at=events.now,
            )
        )
        if changed.rowcount != 1:
            raise StaleLeaseError(lease.job.id, lease.token)
        connection.execute(
            insert(external_calls).values(job_id=lease.job.id, sequence=sequence, **asdict(call))
        )
        events.record_jobs(connection, [lease.job.id], TURN, {"index": sequence})

    def read(
        self, job_id: str, *, connection: Connection, first: int = 0, count: int | None = None
    ) -> list[ExternalCall]:
        """Return the calls of a session, in order.

        Args:
            first: Place of the first of them.
        """
        query = (
            select(*columns_of(ExternalCall, external_calls))
            .where(external_calls.c.job_id == job_id, external_calls.c.sequence >= first)
            .order_by(external_calls.c.sequence)
            .limit(count)
        )
        return [value_of(ExternalCall, row) for row in connection.execute(query)]

    def abandon_idle(self) -> None:
        """Cancel sessions that made no call for a day."""
        with self._database.transaction() as connection:
            transition(
                jobs.c.queue == EXTERNAL_QUEUE,
                jobs.c.available_at < events.now - IDLE_FOR,
                to=JobState.DONE,
                allowed_from={JobState.RUNNING},
                data={"outcome": Outcome.CANCELLED},
                connection=connection,
                outcome=Outcome.CANCELLED,
                reason="abandoned",
                lease_owner=None,
                finished_at=events.now,
            )
