"""The life cycle of sweeps: pause, resume, cancel, retry, and the stop when a budget is used up.

Each command is one transaction that moves the sweep, if it is in a state that may be left for the
new one, and with it the jobs that it pays for and that have no other claim: the others are handed
over to their claimants. Commands exclude each other and submissions by one lock, so that a decision
about a shared job holds until its commit.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from sqlalchemy import ColumnElement, Connection, Row, or_, select, text, update

from buildarena_backend import events
from buildarena_backend.accounts.budgets import BudgetLimits, Budgets
from buildarena_backend.database.account_tables import NEEDS_BUDGET
from buildarena_backend.database.database import Database
from buildarena_backend.database.rows import known
from buildarena_backend.database.tables import jobs, sweep_jobs, sweeps
from buildarena_backend.errors import RefusedError
from buildarena_backend.jobs.files import require_room
from buildarena_backend.jobs.jobs import Jobs
from buildarena_backend.jobs.transitions import transition
from buildarena_backend.results.audits import retry_refuted
from buildarena_backend.states import (
    FILE_PROVIDER,
    JobState,
    Stage,
    SweepState,
    sweep_states_before,
)
from buildarena_backend.sweeps import claims

LIFECYCLE_LOCK = 0x7377656570  # "sweep"


class SweepLifecycle:
    """Commands over sweeps."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self._jobs = Jobs(database)
        self._budgets = Budgets(database)

    @contextmanager
    def submission(self) -> Iterator[Connection]:
        """Yield a transaction that stores sweeps or jobs: no command runs at the same time."""
        with self._database.transaction() as connection:
            lock = text("SELECT pg_advisory_xact_lock_shared(:key)")
            connection.execute(lock, {"key": LIFECYCLE_LOCK})
            yield connection

    @contextmanager
    def command(self) -> Iterator[Connection]:
        """Yield a transaction that excludes other commands and submissions."""
        with self._database.transaction() as connection:
            connection.execute(text("SELECT pg_advisory_xact_lock(:key)"), {"key": LIFECYCLE_LOCK})
            yield connection

    def pause(self, sweep_id: str) -> None:
        """Put the sweep's waiting jobs on hold; running jobs continue.

        Jobs with another claim continue at the claimant's expense.

        Raises:
            UnknownIdError: The sweep does not exist.
            RefusedError: It is not active.
        """
        with self.command() as connection:
            self._move(sweep_id, SweepState.PAUSED, connection)
            self._hold(sweep_id, connection)

    def resume(self, sweep_id: str, limits: BudgetLimits | None = None) -> None:
        """Resume a paused or stopped sweep, with another budget if one is given.

        Raises:
            UnknownIdError: The sweep does not exist.
            RefusedError: It is active or cancelled.
        """
        with self.command() as connection:
            self._move(sweep_id, SweepState.ACTIVE, connection)
            if limits is not None:
                self._budgets.set(sweep_id, limits, connection=connection)
            self._release(sweep_id, self._sweep(sweep_id, connection).owner, connection)

    def set_budget(self, sweep_id: str, limits: BudgetLimits) -> None:
        """Give a sweep another budget; one whose budget was used up continues, a paused one waits.

        Raises:
            UnknownIdError: The sweep does not exist.
            RefusedError: It is cancelled.
        """
        with self.command() as connection:
            sweep = self._sweep(sweep_id, connection)
            if sweep.state == SweepState.CANCELLED:
                raise _stays(sweep_id, sweep.state, SweepState.ACTIVE)
            self._budgets.set(sweep_id, limits, connection=connection)
            if sweep.state == SweepState.BUDGET_EXHAUSTED:
                self._move(sweep_id, SweepState.ACTIVE, connection)
                self._release(sweep_id, sweep.owner, connection)

    def ensure_active(
        self, sweep_id: str, limits: BudgetLimits | None, *, connection: Connection
    ) -> None:
        """Do the same as `resume` in a transaction of `command`; an active sweep gets its budget.

        Raises:
            UnknownIdError: The sweep does not exist.
            RefusedError: It is cancelled.
        """
        sweep = self._sweep(sweep_id, connection)
        if sweep.state != SweepState.ACTIVE:
            self._move(sweep_id, SweepState.ACTIVE, connection)
        if limits is not None:
            self._budgets.set(sweep_id, limits, connection=connection)
        self._release(sweep_id, sweep.owner, connection)

    def cancel(self, sweep_id: str) -> None:
        """End the sweep's jobs that have not ended and have no other claim.

        The others are handed over: to an active sweep or a key, or to a paused or stopped sweep,
        where they wait. The sweep never pays again.

        Raises:
            UnknownIdError: The sweep does not exist.
            RefusedError: It is cancelled already.
        """
        with self.command() as connection:
            self._move(sweep_id, SweepState.CANCELLED, connection)
            self._drop(jobs.c.payer == sweep_id, connection=connection)

    def retry(self, sweep_id: str) -> None:
        """Queue the sweep's errored jobs again, at its expense, except those of other keys.

        They wait on hold while the sweep is not active. A job of another key stays with it, as
        long as that key wants it.

        Raises:
            UnknownIdError: The sweep does not exist.
            RefusedError: It is cancelled.
        """
        with self.command() as connection:
            sweep = self._sweep(sweep_id, connection)
            if sweep.state == SweepState.CANCELLED:
                raise _stays(sweep_id, sweep.state, "retried")
            own = jobs.c.owner.is_not_distinct_from(sweep.owner)
            own |= ~claims.claimed_by_others(sweep.owner)
            self._jobs.retry(
                jobs.c.id.in_(claims.members(sweep_id)),
                own,
                connection=connection,
                payer=sweep_id,
                owner=sweep.owner,
            )
            if sweep.state != SweepState.ACTIVE:
                self._hold(sweep_id, connection)

    def cancel_job(self, job_id: str, *, owner: str | None, force: bool = False) -> bool:
        """Take back a key's claims on a job, and end the job if it is the key's alone.

        Args:
            force: End it despite other claims.

        Returns:
            False when the job has ended already, and nothing was changed.

        Raises:
            UnknownIdError: The job does not exist.
            RefusedError: The key neither owns nor wants it.
        """
        with self.command() as connection:
            job = self._job(job_id, connection)
            if force:
                return bool(self._jobs.cancel([job_id], connection=connection))
            if job.owner != owner and not claims.has_claim(job_id, owner, connection=connection):
                raise _not_owned(job_id)
            if job.state == JobState.DONE:
                return False
            claims.withdraw(job_id, owner, connection=connection)
            if job.owner == owner:
                self._drop(jobs.c.id == job_id, connection=connection, owner=owner)
        return True

    def retry_job(self, job_id: str, *, owner: str | None, force: bool = False) -> bool:
        """Queue an errored job again, paid for by an active sweep of its key or by the key.

        A refuted one whose trials runners ran is simulated again, see `audits.retry_refuted`.

        Args:
            owner: The key that requests it.
            force: Retry also another key's job.

        Returns:
            False when the job has neither errored nor been refuted so.

        Raises:
            UnknownIdError: The job does not exist.
            RefusedError: It is another key's.
            RefusedError: Its machine is a file, and its key has as many under way as may be.
        """
        with self.command() as connection:
            job = self._job(job_id, connection)
            if job.owner != owner and not force:
                raise _not_owned(job_id)
            payers = (
                select(sweeps.c.id)
                .join(sweep_jobs, sweep_jobs.c.sweep_id == sweeps.c.id)
                .where(
                    sweep_jobs.c.job_id == job_id,
                    sweeps.c.owner.is_not_distinct_from(job.owner),
                    sweeps.c.state == SweepState.ACTIVE,
                )
                .order_by((sweeps.c.id == (job.payer or "")).desc(), sweeps.c.created_at)
            )
            payer = connection.execute(payers.limit(1)).scalar()
            retried = self._jobs.retry(
                jobs.c.id == job_id, connection=connection, payer=payer
            ) or retry_refuted(job_id, connection=connection, payer=payer)
            if retried and payer is None:
                claims.add_claim(job_id, job.owner, connection=connection)
            if retried and job.provider == FILE_PROVIDER:
                require_room(job.owner, connection=connection)
        return bool(retried)

    def exhaust(
        self,
        budget_id: str,
        detail: str,
        *,
        connection: Connection,
    ) -> list[str]:
        """Stop the sweeps of a used-up budget; nothing new of them starts that needs of it.

        Jobs with another claimant that pays now go over to it; the waiting ones among the others
        are put on hold.

        Args:
            budget_id: Id of the sweep or key whose budget it is.
            connection: A transaction of `command`.

        Returns:
            Ids of the sweeps that were stopped.
        """
        stopped = self._transition(
            or_(sweeps.c.id == budget_id, sweeps.c.owner == budget_id),
            SweepState.BUDGET_EXHAUSTED,
            connection,
            {"detail": detail},
        )
        paid = (
            or_(jobs.c.payer == budget_id, jobs.c.owner == budget_id),
            jobs.c.stage == Stage.CONSTRUCT,
            NEEDS_BUDGET,
        )
        claims.transfer(*paid, connection=connection, except_owner=budget_id)
        transition(
            *paid,
            to=JobState.ON_HOLD,
            allowed_from={JobState.QUEUED},
            data={"why": detail},
            connection=connection,
        )
        return stopped

    def release_single_jobs(self, key_id: str, *, connection: Connection) -> None:
        """Queue a key's jobs on hold that belong to no sweep."""
        transition(
            jobs.c.owner == key_id,
            jobs.c.payer.is_(None),
            to=JobState.QUEUED,
            allowed_from={JobState.ON_HOLD},
            data={"why": "budget"},
            connection=connection,
        )

    def _hold(self, sweep_id: str, connection: Connection) -> None:
        own = jobs.c.payer == sweep_id
        claims.transfer(own, connection=connection)
        transition(own, to=JobState.ON_HOLD, allowed_from={JobState.QUEUED}, connection=connection)

    def _release(self, sweep_id: str, owner: str | None, connection: Connection) -> None:
        """Make a resumed sweep pay, also for jobs that another paused sweep would have paid for."""
        transition(
            jobs.c.id.in_(claims.members(sweep_id)),
            to=JobState.QUEUED,
            allowed_from={JobState.ON_HOLD},
            connection=connection,
            payer=sweep_id,
            owner=owner,
        )

    def _drop(
        self, which: ColumnElement[bool], *, connection: Connection, **still: str | None
    ) -> None:
        """Hand jobs over to other claimants, and end those that have none.

        Args:
            which: Conditions on the jobs, which hold for none that was handed over.
            still: Columns that are as they were when a job was not handed over.
        """
        waiting = claims.transfer(which, connection=connection, to_waiting=True)
        self._jobs.hold(waiting, connection=connection)
        left = [jobs.c[name].is_not_distinct_from(value) for name, value in still.items()]
        ids = connection.execute(select(jobs.c.id).where(which, *left)).scalars().all()
        self._jobs.cancel(ids, connection=connection)

    def _move(self, sweep_id: str, to: SweepState, connection: Connection) -> None:
        if not self._transition(sweeps.c.id == sweep_id, to, connection, {}):
            raise _stays(sweep_id, self._sweep(sweep_id, connection).state, to)

    def _transition(
        self,
        which: ColumnElement[bool],
        to: SweepState,
        connection: Connection,
        data: Mapping[str, Any],
    ) -> list[str]:
        rows = connection.execute(
            update(sweeps)
            .where(which, sweeps.c.state.in_(sweep_states_before(to)))
            .values(state=to)
            .returning(sweeps.c.id)
        )
        moved = list(rows.scalars())
        for sweep_id in moved:
            events.record_sweep(connection, sweep_id, to, data)
        return moved

    def _sweep(self, sweep_id: str, connection: Connection) -> Row[Any, Any]:
        query = select(sweeps.c.state, sweeps.c.owner).where(sweeps.c.id == sweep_id)
        return known(connection.execute(query).first(), "sweep", sweep_id)

    def _job(self, job_id: str, connection: Connection) -> Row[Any, Any, Any, Any]:
        provider = jobs.c.model_config["provider"].as_string().label("provider")
        query = select(jobs.c.owner, jobs.c.payer, jobs.c.state, provider)
        query = query.where(jobs.c.id == job_id)
        return known(connection.execute(query).first(), "job", job_id)


def _stays(sweep_id: str, state: str, to: str) -> RefusedError:
    return RefusedError("illegal_state", f"sweep {sweep_id} is {state}; it can't become {to}")


def _not_owned(job_id: str) -> RefusedError:
    detail = f"job {job_id} was submitted with another key; only an admin may"
    return RefusedError("not_owner", detail)
