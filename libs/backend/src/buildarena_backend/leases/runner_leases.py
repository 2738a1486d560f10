"""Leases of runners, which name them over HTTP: found by key, job and token.

A lease's owner is ``runner@KEY/NAME``: a key's runners touch no lease of another key, and a runner
that asks again under the same name, because an answer was lost, gets the same lease again.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from datetime import timedelta
from typing import Final

from sqlalchemy import ColumnElement, and_, func, literal_column, select

from buildarena_backend import events
from buildarena_backend.database.database import Database
from buildarena_backend.database.rows import columns_of, value_of
from buildarena_backend.database.tables import attempts, jobs, workers
from buildarena_backend.errors import StaleLeaseError
from buildarena_backend.jobs.job import Job
from buildarena_backend.leases.leases import JobToken, Lease, Leases, are_held
from buildarena_backend.leases.lost_leases import EXPIRES_AT
from buildarena_backend.leases.runner_backoff import MIN_KEYS, MISSED_BEFORE, OTHERS_REFUSED, RUNNER
from buildarena_backend.states import AttemptResult, JobState

OPERATOR_KEY: Final = "operator"
"""Placeholder for the key where none is required."""
UNCONFIRMED: Final = "; it waits for a runner of another key, or a worker next to the database"
LONGEST_TRIAL: Final = timedelta(hours=1)
"""A lease that is older is renewed no more: a runner must not keep a job forever."""


def runner_prefix(key_id: str | None) -> str:
    """Return the prefix of the lease owners of a key's runners."""
    return f"{RUNNER}{key_id or OPERATOR_KEY}/"


def prefix_of(owner: str) -> str:
    """Return the prefix that lease owners of the same key's runners share."""
    return owner[: owner.index("/") + 1]


class RunnerLeases:
    """Finds and renews the leases of one key's runners at a time.

    Args:
        leases: All leases, of which these are some.
    """

    def __init__(self, database: Database, leases: Leases) -> None:
        self._database = database
        self._leases = leases

    def of(self, owner: str) -> Lease | None:
        """Return the live lease that a runner has under exactly this name, if any."""
        query = select(*_COLUMNS).where(
            jobs.c.state == JobState.RUNNING,
            jobs.c.lease_owner == owner,
            events.now < EXPIRES_AT,
        )
        row = self._database.first_row(query.limit(1))
        return None if row is None else _lease(row)

    def hand_back(self, runner: str) -> None:
        """Hand back all leases of a runner that leaves, even those that it never received.

        Args:
            runner: Its name; its slots are called ``NAME.NUMBER``.
        """
        query = select(*_COLUMNS).where(
            jobs.c.state == JobState.RUNNING,
            jobs.c.lease_owner.regexp_match(rf"^{re.escape(runner)}(\.[0-9]+)?$"),
        )
        held = [_lease(row) for row in self._database.all_rows(query)]
        self._leases.hand_back_all(held)

    def live(self, job_id: str, token: int, prefix: str) -> Lease:
        """Return the lease that a key's runner names.

        Raises:
            StaleLeaseError: It is over, never was, or is not this key's.
        """
        query = select(*_COLUMNS).where(
            jobs.c.id == job_id,
            jobs.c.lease_token == token,
            jobs.c.state == JobState.RUNNING,
            _begins(jobs.c.lease_owner, prefix),
        )
        row = self._database.first_row(query)
        if row is None:
            raise StaleLeaseError(job_id, token)
        return _lease(row)

    def ending(self, job_id: str, token: int, prefix: str) -> str | None:
        """Return the result of an attempt by a key's runner; None if it runs or is not its own."""
        query = select(attempts.c.result).where(
            attempts.c.job_id == job_id,
            attempts.c.token == token,
            _begins(attempts.c.worker, prefix),
        )
        result: str | None = self._database.first_value(query)
        return result

    def heartbeat(self, named: Collection[JobToken], prefix: str) -> set[JobToken]:
        """Renew leases of a key's runners.

        Returns:
            Those that live on; work on the others must stop.
        """
        if not named:
            return set()
        young = (
            select(attempts)
            .where(
                attempts.c.job_id == jobs.c.id,
                attempts.c.token == jobs.c.lease_token,
                attempts.c.started_at > events.now - LONGEST_TRIAL,
            )
            .exists()
        )
        held = and_(are_held(named), _begins(jobs.c.lease_owner, prefix), young)
        statement = self._leases.renewal(held).returning(jobs.c.id, jobs.c.lease_token)
        return {(row.id, row.lease_token) for row in self._database.all_rows(statement)}

    def fault(self, lease: Lease, detail: str, *, reason: str, permanent: bool = False) -> bool:
        """Record a runner's report against a job; its key counts once, even if it repeats it.

        The job waits for others at once, and for the key longer each time, see `misses`. It ends
        when runners of two keys say that it never can be done, or when as many keys and workers of
        the house failed as may.

        Args:
            lease: The runner's lease, which ends.
            reason: The class of the fault, for the dead-letter view.
            permanent: Whether no attempt of the key's runners can fix it.

        Returns:
            True when the job will be tried again.
        """
        with self._database.transaction() as connection:
            standing = select(
                jobs.c.faults,
                literal_column(MISSED_BEFORE).label("missed_before"),
                literal_column(OTHERS_REFUSED).label("others_refused"),
            ).where(jobs.c.id == lease.job.id, jobs.c.lease_owner == lease.owner)
            job = connection.execute(standing).first()
            if job is None:
                raise StaleLeaseError(lease.job.id, lease.token)
            faults = job.faults + (not job.missed_before)
            agreed = permanent and job.others_refused
            result = AttemptResult.PERMANENT_FAULT if permanent else AttemptResult.FAULT
            if agreed or faults >= max(self._leases.max_faults, MIN_KEYS):
                self._leases.end_as_errored(
                    lease, detail, reason=reason, connection=connection, result=result
                )
                return False
            self._leases.advance(
                lease,
                to=JobState.QUEUED,
                connection=connection,
                result=result,
                note=detail,
                faults=faults,
                detail=detail + UNCONFIRMED * permanent,
            )
        return True

    def alive(self, named: Collection[JobToken]) -> set[JobToken]:
        """Return those of the leases, whoever's, that are not over."""
        if not named:
            return set()
        query = select(jobs.c.id, jobs.c.lease_token).where(are_held(named))
        return {(row.id, row.lease_token) for row in self._database.all_rows(query)}

    def counts(self, prefix: str, *, besides: str) -> Mapping[str, int]:
        """Return a key's numbers of ``leases`` and of ``names`` in the register of workers.

        Args:
            prefix: The key's.
            besides: The name of the one that asks, which is not counted.
        """
        leases = select(func.count()).where(
            jobs.c.state == JobState.RUNNING, _begins(jobs.c.lease_owner, prefix)
        )
        names = select(func.count()).where(
            _begins(workers.c.id, prefix),
            workers.c.id != besides,
            workers.c.last_heartbeat_at > events.now - timedelta(minutes=1),
        )
        query = select(
            leases.scalar_subquery().label("leases"), names.scalar_subquery().label("names")
        )
        with self._database.statement() as connection:
            row = connection.execute(query).one()
        return {"leases": row.leases, "names": row.names}


_COLUMNS = columns_of(Job, jobs)


def _lease(row: object) -> Lease:
    job = value_of(Job, row)
    return Lease(job=job, owner=str(job.lease_owner), token=job.lease_token)


def _begins(column: ColumnElement[str], prefix: str) -> ColumnElement[bool]:
    return func.starts_with(column, prefix)
