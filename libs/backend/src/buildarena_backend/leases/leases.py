"""Leases: exclusive rights to work on a job, and the writes that only their holders may make.

Every claim raises the job's fencing token. A write names its token; when the job has a newer
one, or has stopped running, nothing is written and StaleLeaseError is raised. All times are
the database's, so a worker with a wrong clock does no harm.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from datetime import timedelta
from typing import Any, Final

from sqlalchemy import (
    BigInteger,
    ColumnElement,
    Connection,
    Update,
    and_,
    cast,
    delete,
    func,
    select,
    tuple_,
    update,
)
from sqlalchemy.dialects.postgresql import ARRAY

from buildarena_backend import events
from buildarena_backend.database.account_tables import PAYS, budgets
from buildarena_backend.database.database import Database
from buildarena_backend.database.rows import bound_texts, value_of
from buildarena_backend.database.tables import jobs
from buildarena_backend.database.tables import leases as expiries
from buildarena_backend.errors import StaleLeaseError
from buildarena_backend.jobs.attempts import end_running
from buildarena_backend.jobs.job import Job
from buildarena_backend.leases.claiming import CLAIM
from buildarena_backend.leases.lost_leases import recover_lost
from buildarena_backend.leases.runner_backoff import require_fewer_leases
from buildarena_backend.states import AttemptResult, JobState, Outcome, Stage

JobToken = tuple[str, int]
LONGEST_DELAY_S = 300.0
"""A job waits no longer than this between two attempts."""
REMEMBERED: Final = timedelta(hours=1)
"""Time for which the end of a lease is remembered."""


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
        """True if this is the job's first lease, so that it has neither journal nor rollouts."""
        return self.token == 1


def are_named(leases: Collection[JobToken]) -> ColumnElement[bool]:
    """Return the condition that a job has one of these tokens, whatever its state."""
    # Two arrays, and not a parameter each: one short statement for any number of leases.
    tokens = cast([token for _, token in leases], ARRAY(BigInteger))
    pairs = func.unnest(bound_texts([job_id for job_id, _ in leases]), tokens)
    named = select(pairs.table_valued("job_id", "token").render_derived())
    return tuple_(jobs.c.id, jobs.c.lease_token).in_(named)


def are_held(leases: Collection[JobToken]) -> ColumnElement[bool]:
    """Return the condition that a row of `jobs` has one of these leases now."""
    return and_(jobs.c.state == JobState.RUNNING, are_named(leases))


class Leases:
    """Claims, renews, hands over and ends leases.

    Args:
        duration_s: Seconds that a lease is valid without a heartbeat.
        max_faults: Infrastructure faults without progress after which a job is given up.
    """

    def __init__(
        self, database: Database, *, duration_s: float = 15.0, max_faults: int = 8
    ) -> None:
        self._database = database
        self.duration = timedelta(seconds=duration_s)
        self.max_faults = max_faults

    def claim(
        self,
        queue: str,
        *,
        owner: str,
        full: Sequence[str] = (),
        last: str | None = None,
        only: Sequence[str] | None = None,
        version: str | None = None,
        prefix: str | None = None,
        max_leases: int = 0,
    ) -> Lease | None:
        """Take a waiting job of a queue: a recovered one first, then the oldest.

        Owners take turns: a job of the owner that had the last turn is only taken when no other
        owner has one.

        Args:
            owner: The worker's id.
            full: Owners whose jobs may not be taken now.
            last: The owner whose job was taken last.
            only: Owners whose jobs may be taken; None for all.
            version: The simulator's version that jobs must have been submitted for, if given.
            prefix: Start of the ids of a key's runners; jobs they missed are passed over.
            max_leases: Leases that these may have at once.

        Returns:
            The lease, or None when no job waits.

        Raises:
            RefusedError: The key's runners have as many leases as they may.
        """
        parameters = {
            "queue": queue,
            "owner": owner,
            "duration": self.duration,
            "full": list(full),
            "last": last,
            "only": None if only is None else list(only),
            "version": version,
            "prefix": prefix,
        }
        if prefix is None:
            row = self._database.first_row(CLAIM, parameters)
        else:
            with self._database.transaction() as connection:
                require_fewer_leases(prefix, max_leases, connection=connection)
                row = connection.execute(CLAIM, parameters).first()
        if row is None:
            return None
        job = value_of(Job, row)
        return Lease(job=job, owner=owner, token=job.lease_token, budgeted=row.budgeted)

    def heartbeat(self, leases: Sequence[Lease]) -> dict[str, bool]:
        """Renew leases.

        Returns:
            Ids of the jobs whose lease is still ours, each with whether a budget pays for the
            job now; work on the others must stop.
        """
        if not leases:
            return {}
        rows = self._database.all_rows(self.renewal(_ours(leases)).returning(jobs.c.id, _BUDGETED))
        return {row.id: row.budgeted for row in rows}

    def renewal(self, held: ColumnElement[bool]) -> Update:
        """Return a statement that renews some jobs' leases; it may return columns of `jobs`."""
        return (
            update(expiries)
            .where(expiries.c.job_id == jobs.c.id, expiries.c.token == jobs.c.lease_token, held)
            .values(expires_at=events.now + self.duration)
        )

    def held(self, leases: Sequence[Lease]) -> dict[str, bool]:
        """Return the same as `heartbeat` without renewing anything: it only reads."""
        if not leases:
            return {}
        rows = self._database.all_rows(select(jobs.c.id, _BUDGETED).where(_ours(leases)))
        return {row.id: row.budgeted for row in rows}

    def advance(
        self,
        lease: Lease,
        *,
        to: JobState,
        connection: Connection,
        result: AttemptResult = AttemptResult.DONE,
        note: str | None = None,
        **values: Any,
    ) -> None:
        """End the lease with its attempt and write the job's next place, all or nothing.

        Args:
            lease: The lease that ends.
            to: The job's next state.
            connection: The transaction that also holds what belongs to this step.
            note: A sentence for people, kept with the attempt.
            values: Further columns of the job to set.

        Raises:
            StaleLeaseError: The lease is over; the transaction must be undone.
        """
        data = {name: values[name] for name in ("stage", "outcome", "reason") if values.get(name)}
        held = and_(jobs.c.id == lease.job.id, jobs.c.lease_token == lease.token)
        statement = end_running(held, to, data, result, detail=note, values=values)
        if connection.execute(statement).first() is None:
            raise StaleLeaseError(lease.job.id, lease.token)

    def requeue(
        self, lease: Lease, *, stage: Stage, queue: str, connection: Connection, **values: Any
    ) -> None:
        """Pass the job on to a stage, to be claimed again there; its faults are forgotten."""
        self.advance(
            lease,
            to=JobState.QUEUED,
            connection=connection,
            stage=stage,
            queue=queue,
            faults=0,
            available_at=events.now,
            **values,
        )

    def hand_back(self, lease: Lease) -> None:
        """Give up the work without fault.

        Raises:
            StaleLeaseError: The lease is over.
        """
        if not self.hand_back_all([lease]):
            raise StaleLeaseError(lease.job.id, lease.token)

    def hand_back_all(self, leases: Sequence[Lease]) -> set[str]:
        """Give up the work on many jobs in one statement, for example when a worker stops.

        Returns:
            Ids of the jobs that wait again; the leases of the others were over.
        """
        if not leases:
            return set()
        ours = are_named([(lease.job.id, lease.token) for lease in leases])
        given_back = end_running(ours, JobState.QUEUED, {}, AttemptResult.HANDED_BACK)
        return set(self._database.all_values(given_back))

    def fault(
        self,
        lease: Lease,
        detail: str,
        *,
        delay_s: float = 0.0,
        reason: str,
        endless: bool = False,
    ) -> bool:
        """Record an infrastructure fault: the job waits for another attempt, or is given up.

        Args:
            lease: The lease that ends.
            delay_s: Wait before the job may be claimed again, after the first fault; twice as long
                after each further one, up to LONGEST_DELAY_S.
            reason: The class of the fault, for the dead-letter view.
            endless: Whether the job is not given up for it.

        Returns:
            True when the job will be tried again.
        """
        with self._database.transaction() as connection:
            met = select(jobs.c.faults).where(jobs.c.id == lease.job.id)
            faults = int(connection.execute(met).scalar_one()) + 1
            retried = endless or faults < self.max_faults
            wait_s = min(delay_s * 2 ** min(faults - 1, 20), LONGEST_DELAY_S)
            if retried:
                self.advance(
                    lease,
                    to=JobState.QUEUED,
                    connection=connection,
                    result=AttemptResult.FAULT,
                    note=detail,
                    faults=faults,
                    available_at=events.now + timedelta(seconds=wait_s),
                    detail=detail,
                )
            else:
                self.end_as_errored(lease, detail, reason=reason, connection=connection)
        return retried

    def give_up(self, lease: Lease, detail: str, *, reason: str) -> None:
        """End the job as errored: outside every average, and kept in the dead-letter view."""
        with self._database.transaction() as connection:
            self.end_as_errored(lease, detail, reason=reason, connection=connection)

    def end_as_errored(
        self,
        lease: Lease,
        detail: str,
        *,
        reason: str,
        connection: Connection,
        result: AttemptResult = AttemptResult.FAULT,
    ) -> None:
        """Do the same as `give_up` in a transaction, with the attempt's result."""
        self.advance(
            lease,
            to=JobState.DONE,
            connection=connection,
            result=result,
            note=detail,
            outcome=Outcome.ERRORED,
            reason=reason,
            faults=jobs.c.faults + 1,
            finished_at=events.now,
            detail=detail,
        )

    def recover(self) -> list[str]:
        """Re-queue jobs whose lease ran out, and give up those that keep losing their workers.

        Returns:
            Ids of the jobs that wait again.
        """
        return recover_lost(self._database, max_faults=self.max_faults)

    def forget_ended(self) -> None:
        """Forget leases that ended an hour ago or earlier."""
        theirs = and_(
            jobs.c.id == expiries.c.job_id,
            jobs.c.lease_token == expiries.c.token,
            jobs.c.state == JobState.RUNNING,
        )
        ended = expiries.c.expires_at < events.now - REMEMBERED
        self._database.run(delete(expiries).where(ended, ~select(jobs).where(theirs).exists()))


def _ours(leases: Sequence[Lease]) -> ColumnElement[bool]:
    return are_held([(lease.job.id, lease.token) for lease in leases])


_BUDGETED = select(budgets).where(PAYS).correlate(jobs).exists().label("budgeted")
