"""Attempts: one worker's work on one stage of a job, and its result."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import lru_cache
from typing import Any

from sqlalchemy import ClauseElement, Connection, TextClause, bindparam, text
from sqlalchemy.dialects import postgresql

from buildarena_backend.database.account_tables import MAX_USD
from buildarena_backend.database.tables import jobs
from buildarena_backend.errors import StaleLeaseError
from buildarena_backend.states import AttemptResult, JobState


@dataclass(frozen=True, slots=True, kw_only=True)
class Attempt:
    """A worker's attempt at a job's stage: owner, times and result."""

    token: int
    stage: str
    worker: str
    started_at: datetime
    ended_at: datetime | None
    result: str | None
    detail: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Ending:
    """The end of an attempt, and where it left its job.

    Attributes:
        token: The fencing token of the attempt's lease.
        state: The job's state from now on.
        data: Sent to listeners with the new state.
    """

    job_id: str
    token: int
    state: JobState
    data: Mapping[str, Any]


# One statement, because every stage of every job waits for it.
_END = text(
    """
    WITH ending AS (
        SELECT * FROM unnest(
            CAST(:job_ids AS text[]), CAST(:tokens AS bigint[]),
            CAST(:states AS text[]), CAST(:data AS text[])
        ) AS ending (job_id, token, state, data)
    ), released AS (
        DELETE FROM reservations USING ending WHERE reservations.job_id = ending.job_id
        RETURNING reservations.budget_id, reservations.cost_usd
    ), lost AS (
        UPDATE budgets SET lost_requests = lost_requests + released.requests,
            lost_cost_usd = LEAST(lost_cost_usd + released.cost_usd, :max_usd)
        FROM (
            SELECT budget_id, count(*) AS requests, sum(cost_usd) AS cost_usd FROM released
            GROUP BY budget_id
        ) AS released
        WHERE :is_lost AND budgets.id = released.budget_id
    ), ended AS (
        UPDATE attempts SET ended_at = clock_timestamp(), result = :result, detail = :detail
        FROM ending
        WHERE attempts.job_id = ending.job_id AND attempts.token = ending.token
            AND attempts.ended_at IS NULL
    )
    INSERT INTO events (job_id, kind, data)
    SELECT job_id, state, CAST(data AS jsonb) FROM ending
    """
)


def end_attempts(
    endings: Sequence[Ending],
    result: AttemptResult,
    detail: str | None,
    *,
    connection: Connection,
) -> None:
    """End attempts: release their requests' reservations and record the jobs' states.

    What was reserved under a lease that was lost may have been paid for: the budgets count it.

    Args:
        endings: The attempts; a job without a running one just gets its event.
        detail: A sentence for people.
        connection: The transaction that also moved the jobs.
    """
    if not endings:
        return
    parameters = {
        "job_ids": [ending.job_id for ending in endings],
        "tokens": [ending.token for ending in endings],
        "states": [str(ending.state) for ending in endings],
        "data": [json.dumps(dict(ending.data)) for ending in endings],
        "result": str(result),
        "detail": detail,
        "is_lost": result == AttemptResult.LOST,
        "max_usd": MAX_USD,
    }
    connection.execute(_END, parameters)


# One statement with the end of the attempt, for the same reason. The clauses that a job's row is
# found by are those of every write under a lease.
_MOVE = f"""
    WITH moved AS (
        UPDATE jobs SET
            state = :to_state, lease_owner = NULL{{settings}}
        WHERE id = :of_job AND lease_token = :of_token AND state = '{JobState.RUNNING}'
        RETURNING id
    ), released AS (
        DELETE FROM reservations USING moved WHERE reservations.job_id = moved.id
    ), ended AS (
        UPDATE attempts SET ended_at = clock_timestamp(), result = :how, detail = :note
        FROM moved
        WHERE attempts.job_id = moved.id AND attempts.token = :of_token
            AND attempts.ended_at IS NULL
    )
    INSERT INTO events (job_id, kind, data)
    SELECT id, :to_state, CAST(:event AS jsonb) FROM moved
"""  # noqa: S608 - the state is our own constant


def move_on(
    ending: Ending,
    result: AttemptResult,
    detail: str | None,
    values: Mapping[str, Any],
    *,
    connection: Connection,
) -> None:
    """End an attempt as `end_attempts` does, and write its job's next place with it.

    Args:
        ending: The attempt, whose lease must hold.
        detail: A sentence for people.
        values: Further columns of the job, plain values or expressions.
        connection: The transaction that also holds what belongs to this step.

    Raises:
        StaleLeaseError: The lease is over; the transaction must be undone.
    """
    expressions = {
        name: _sql(value) for name, value in values.items() if isinstance(value, ClauseElement)
    }
    plain = {name: value for name, value in values.items() if name not in expressions}
    parameters = {
        "of_job": ending.job_id,
        "of_token": ending.token,
        "to_state": str(ending.state),
        "how": str(result),
        "note": detail,
        "event": json.dumps(dict(ending.data)),
    }
    statement = _moving(tuple(plain), tuple(expressions.items()))
    if connection.execute(statement, {**plain, **parameters}).rowcount != 1:
        raise StaleLeaseError(ending.job_id, ending.token)


# A worker that stops has hundreds of leases and little time: all go back in one statement.
_HAND_BACK = text(
    f"""
    WITH given AS (
        SELECT * FROM unnest(CAST(:job_ids AS text[]), CAST(:tokens AS bigint[]))
        AS given (job_id, token)
    ), moved AS (
        UPDATE jobs SET
            state = '{JobState.QUEUED}', lease_owner = NULL
        FROM given
        WHERE jobs.id = given.job_id AND jobs.lease_token = given.token
            AND jobs.state = '{JobState.RUNNING}'
        RETURNING jobs.id, given.token
    ), released AS (
        DELETE FROM reservations USING moved WHERE reservations.job_id = moved.id
    ), ended AS (
        UPDATE attempts SET ended_at = clock_timestamp(), result = '{AttemptResult.HANDED_BACK}'
        FROM moved
        WHERE attempts.job_id = moved.id AND attempts.token = moved.token
            AND attempts.ended_at IS NULL
    ), recorded AS (
        INSERT INTO events (job_id, kind, data)
        SELECT id, '{JobState.QUEUED}', '{{}}' FROM moved
    )
    SELECT id FROM moved
    """  # noqa: S608 - the states are our own constants
)


def hand_back(attempts: Sequence[tuple[str, int]], *, connection: Connection) -> set[str]:
    """End attempts without fault and have their jobs wait again, as far as their leases hold.

    Args:
        attempts: Id of the job and fencing token of each.

    Returns:
        Ids of the jobs that wait again.
    """
    keys = {"job_ids": [job for job, _ in attempts], "tokens": [token for _, token in attempts]}
    return set(connection.execute(_HAND_BACK, keys).scalars())


# Made once for each way a job continues, because making a statement takes longer than running it.
@lru_cache(maxsize=64)
def _moving(plain: tuple[str, ...], expressions: tuple[tuple[str, str], ...]) -> TextClause:
    settings = [f"{name} = :{name}" for name in plain]
    settings += [f"{name} = {sql}" for name, sql in expressions]
    statement = text(_MOVE.format(settings="".join(f", {setting}" for setting in settings)))
    return statement.bindparams(*(bindparam(name, type_=jobs.c[name].type) for name in plain))


@lru_cache(maxsize=64)
def _sql(expression: ClauseElement) -> str:
    dialect = postgresql.dialect()  # type: ignore[no-untyped-call]
    return str(expression.compile(dialect=dialect, compile_kwargs={"literal_binds": True}))
