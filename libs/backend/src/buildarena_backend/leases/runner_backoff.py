"""Misses of runner keys: trials that were leased and not completed.

A runner may fail, by fault or on purpose, and harms only itself by it: each key counts once against
a job, however often it fails, and gets the job again after a while that grows, or never if it said
that it never can do it. Workers of the house are not counted here.
"""

from __future__ import annotations

from typing import Final

from sqlalchemy import Connection, func, select

from buildarena_backend.database.tables import jobs
from buildarena_backend.errors import RefusedError
from buildarena_backend.states import AttemptResult, JobState

RUNNER: Final = "runner@"
"""Prefix of the lease owners of all runners; see `runner_leases.runner_prefix`."""
MIN_KEYS: Final = 2
"""Keys whose runners must agree before their reports end a job."""
CLAIM_LOCK: Final = 0x72756E  # "run"
LONGEST_PAUSE_S: Final = 300
"""A key gets a job that it missed again after this time at the latest."""

_MISSES: Final = ", ".join(
    f"'{result}'"
    for result in (
        AttemptResult.FAULT,
        AttemptResult.PERMANENT_FAULT,
        AttemptResult.HANDED_BACK,
        AttemptResult.LOST,
    )
)
_MISSED: Final = f"""
    FROM attempts AS missed
    WHERE missed.job_id = jobs.id AND missed.result IN ({_MISSES})
        AND missed.token > COALESCE((
            SELECT max(done.token) FROM attempts AS done
            WHERE done.job_id = jobs.id AND done.result = '{AttemptResult.DONE}'
        ), 0)
"""  # noqa: S608 - constants only

MISSED_LATELY: Final = f"""
    SELECT FROM (
        SELECT count(*) AS times, max(missed.ended_at) AS at,
            bool_or(missed.result = '{AttemptResult.PERMANENT_FAULT}') AS never
        {_MISSED} AND starts_with(missed.worker, :prefix)
    ) AS misses
    WHERE never OR at > clock_timestamp()
        - LEAST({LONGEST_PAUSE_S}, power(2, LEAST(times, 20))) * interval '1 second'
"""
"""A row of no columns where a job in ``jobs`` is none for the key of ``:prefix`` now."""

MISSED_BEFORE: Final = f"""
    EXISTS (SELECT {_MISSED}
        AND starts_with(missed.worker, split_part(jobs.lease_owner, '/', 1) || '/'))
"""
"""Whether the key whose runner has a job now missed it before."""

OTHERS_REFUSED: Final = f"""
    EXISTS (SELECT {_MISSED}
        AND missed.result = '{AttemptResult.PERMANENT_FAULT}'
        AND NOT starts_with(missed.worker, split_part(jobs.lease_owner, '/', 1) || '/'))
"""
"""Whether a runner of another key than the present one reported the job as impossible."""


def require_fewer_leases(prefix: str, max_leases: int, *, connection: Connection) -> None:
    """Have a key's claims wait for each other, and count its leases.

    Args:
        prefix: Start of the names of the key's runners.
        connection: The transaction that claims one more.

    Raises:
        RefusedError: They have that many already.
    """
    lock = func.pg_advisory_xact_lock(CLAIM_LOCK, func.hashtext(prefix))
    connection.execute(select(lock))
    leases = select(func.count()).where(
        jobs.c.state == JobState.RUNNING, func.starts_with(jobs.c.lease_owner, prefix)
    )
    number = connection.execute(leases).scalar_one()
    if number >= max_leases:
        raise RefusedError(
            "too_many_open",
            f"the key's runners have {number} leases, of {max_leases} that they may have",
        )
