"""The life cycle of sweeps: pause, resume, cancel, retry, and the stop when a budget is used up.

Each command is one transaction that moves the sweep, if it is in a state that may be left for the
new one, and with it the jobs that no other active sweep wants. Commands exclude each other and
submissions by one lock, so that what one of them decides about a shared job holds until its commit.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from sqlalchemy import ColumnElement, Connection, Select, func, literal, or_, select, text, update
from sqlalchemy.dialects.postgresql import distinct_on

from buildarena_store import events
from buildarena_store.accounts.budgets import BudgetLimits, Budgets
from buildarena_store.database import Database
from buildarena_store.errors import TransitionError, UnknownIdError
from buildarena_store.jobs.jobs import Jobs
from buildarena_store.jobs.transitions import transition
from buildarena_store.states import JobState, Stage, SweepState, sweep_states_before
from buildarena_store.tables import jobs, sweep_jobs, sweeps

LIFECYCLE_LOCK = 0x7377656570  # "sweep"


class SweepLifecycle:
    """Commands over sweeps."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self._jobs = Jobs(database)
        self._budgets = Budgets(database)

    @contextmanager
    def submission(self) -> Iterator[Connection]:
        """A transaction that stores sweeps or jobs: no command runs beside it."""
        with self._database.transaction() as connection:
            lock = text("SELECT pg_advisory_xact_lock_shared(:key)")
            connection.execute(lock, {"key": LIFECYCLE_LOCK})
            yield connection

    @contextmanager
    def command(self) -> Iterator[Connection]:
        """A transaction beside which no other command and no submission runs."""
        with self._database.transaction() as connection:
            connection.execute(text("SELECT pg_advisory_xact_lock(:key)"), {"key": LIFECYCLE_LOCK})
            yield connection

    def pause(self, sweep_id: str) -> None:
        """Puts the sweep's waiting jobs on hold; running jobs continue.

        Raises:
            UnknownIdError: There is no such sweep.
            TransitionError: It is not active.
        """
        with self.command() as connection:
            self._move(sweep_id, SweepState.PAUSED, connection)
            self._hold(sweep_id, connection)

    def resume(self, sweep_id: str, limits: BudgetLimits | None = None) -> None:
        """Resumes a paused or stopped sweep, with another budget if one is given.

        Raises:
            UnknownIdError: There is no such sweep.
            TransitionError: It is active or cancelled.
        """
        with self.command() as connection:
            self._move(sweep_id, SweepState.ACTIVE, connection)
            if limits is not None:
                self._budgets.set(sweep_id, limits, connection=connection)
            self._release(sweep_id, connection)

    def ensure_active(
        self, sweep_id: str, limits: BudgetLimits | None, *, connection: Connection
    ) -> None:
        """As `resume`, in a transaction of `command`; an active sweep just gets its budget.

        Raises:
            UnknownIdError: There is no such sweep.
            TransitionError: It is cancelled.
        """
        if self._state(sweep_id, connection) != SweepState.ACTIVE:
            self._move(sweep_id, SweepState.ACTIVE, connection)
        if limits is not None:
            self._budgets.set(sweep_id, limits, connection=connection)
        self._release(sweep_id, connection)

    def cancel(self, sweep_id: str) -> None:
        """Ends the sweep's jobs that have not ended and that no other active sweep wants.

        Raises:
            UnknownIdError: There is no such sweep.
            TransitionError: It is cancelled already.
        """
        with self.command() as connection:
            self._move(sweep_id, SweepState.CANCELLED, connection)
            own = connection.execute(_own_jobs(sweep_id)).scalars().all()
            self._jobs.cancel(own, connection=connection)

    def retry(self, sweep_id: str) -> None:
        """Queues the sweep's errored jobs again; they wait on hold while the sweep is not active.

        Raises:
            UnknownIdError: There is no such sweep.
            TransitionError: It is cancelled.
        """
        with self.command() as connection:
            state = self._state(sweep_id, connection)
            if state == SweepState.CANCELLED:
                raise TransitionError("sweep", sweep_id, state, "retried")
            members = select(sweep_jobs.c.job_id).where(sweep_jobs.c.sweep_id == sweep_id)
            self._jobs.retry(connection.execute(members).scalars().all(), connection=connection)
            if state != SweepState.ACTIVE:
                self._hold(sweep_id, connection)

    def exhaust(self, budget_id: str, detail: str, *, connection: Connection) -> list[str]:
        """Stops the sweeps of a used-up budget; nothing new of them starts.

        Waiting jobs that another active sweep with another budget wants go over to that sweep;
        the others are put on hold.

        Args:
            budget_id: Id of the sweep or key whose budget it is.
            detail: What is lacking, for people.
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
        )
        _hand_over(*paid, jobs.c.state == JobState.QUEUED, connection=connection)
        transition(
            *paid,
            to=JobState.ON_HOLD,
            allowed_from={JobState.QUEUED},
            data={"why": detail},
            connection=connection,
        )
        return stopped

    def release_single_jobs(self, key_id: str, *, connection: Connection) -> None:
        """Queues a key's jobs on hold that belong to no sweep."""
        transition(
            jobs.c.owner == key_id,
            jobs.c.payer.is_(None),
            to=JobState.QUEUED,
            allowed_from={JobState.ON_HOLD},
            data={"why": "budget"},
            connection=connection,
        )

    def _hold(self, sweep_id: str, connection: Connection) -> None:
        transition(
            jobs.c.id.in_(_own_jobs(sweep_id)),
            to=JobState.ON_HOLD,
            allowed_from={JobState.QUEUED},
            connection=connection,
        )

    def _release(self, sweep_id: str, connection: Connection) -> None:
        transition(
            jobs.c.id.in_(_own_jobs(sweep_id)),
            to=JobState.QUEUED,
            allowed_from={JobState.ON_HOLD},
            connection=connection,
        )

    def _move(self, sweep_id: str, to: SweepState, connection: Connection) -> None:
        if not self._transition(sweeps.c.id == sweep_id, to, connection, {}):
            raise TransitionError("sweep", sweep_id, self._state(sweep_id, connection), to)

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

    def _state(self, sweep_id: str, connection: Connection) -> str:
        query = select(sweeps.c.state).where(sweeps.c.id == sweep_id)
        state: str | None = connection.execute(query).scalar()
        if state is None:
            raise UnknownIdError("sweep", sweep_id)
        return state


def _own_jobs(sweep_id: str) -> Select[Any]:
    """Ids of the sweep's jobs that no other active sweep wants."""
    other = sweep_jobs.alias("other")
    wanted = (
        select(literal(1))
        .select_from(other.join(sweeps, sweeps.c.id == other.c.sweep_id))
        .where(
            other.c.job_id == sweep_jobs.c.job_id,
            other.c.sweep_id != sweep_id,
            sweeps.c.state == SweepState.ACTIVE,
        )
        .exists()
    )
    return select(sweep_jobs.c.job_id).where(sweep_jobs.c.sweep_id == sweep_id, ~wanted)


def _hand_over(*which: ColumnElement[bool], connection: Connection) -> None:
    """Makes another active sweep, where one wants a job, the one that pays for it."""
    taker = (
        select(sweeps.c.id, sweeps.c.owner, sweep_jobs.c.job_id)
        .join(sweep_jobs, sweep_jobs.c.sweep_id == sweeps.c.id)
        .where(sweeps.c.state == SweepState.ACTIVE)
        .ext(distinct_on(sweep_jobs.c.job_id))
        .order_by(sweep_jobs.c.job_id, sweeps.c.created_at)
        .subquery("taker")
    )
    connection.execute(
        update(jobs)
        .where(*which, taker.c.job_id == jobs.c.id, taker.c.id != func.coalesce(jobs.c.payer, ""))
        .values(payer=taker.c.id, owner=taker.c.owner)
    )
