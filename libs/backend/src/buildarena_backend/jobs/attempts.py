"""Attempts: one worker's work on one stage of a job, and its result."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from pydantic import with_config
from sqlalchemy import (
    ColumnElement,
    Connection,
    Select,
    cast,
    delete,
    func,
    insert,
    literal,
    select,
    text,
    update,
)
from sqlalchemy.dialects.postgresql import JSONB

from buildarena_backend.database.account_tables import MAX_USD, reservations
from buildarena_backend.database.tables import attempts, events, jobs
from buildarena_backend.states import AttemptResult, JobState, Stage


@with_config(use_attribute_docstrings=True, revalidate_instances="always")
@dataclass(frozen=True, slots=True, kw_only=True)
class Attempt:
    """A worker's attempt at a job's stage."""

    token: int
    """Fencing token: grows with every attempt."""
    stage: Stage
    worker: str
    started_at: datetime
    finished_at: datetime | None
    result: AttemptResult | None
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
def end_running(
    which: ColumnElement[bool],
    to: JobState,
    data: Mapping[str, Any],
    result: AttemptResult,
    *,
    detail: str | None = None,
    values: Mapping[str, Any] | None = None,
) -> Select[str]:
    """Return a statement that ends attempts and writes their jobs' next place with it.

    Args:
        which: The jobs, with their fencing tokens; those that do not run stay as they are.
        to: Their state from now on.
        data: Sent to listeners with the new state.
        detail: A sentence for people.
        values: Further columns of the jobs.

    Returns:
        The statement; its rows are the ids of the jobs that it moved.
    """
    moved = (
        update(jobs)
        .where(which, jobs.c.state == JobState.RUNNING)
        .values(state=to, lease_owner=None, **(values or {}))
        .returning(jobs.c.id, jobs.c.lease_token)
        .cte("moved")
    )
    released = delete(reservations).where(reservations.c.job_id == moved.c.id)
    ended = (
        update(attempts)
        .where(
            attempts.c.job_id == moved.c.id,
            attempts.c.token == moved.c.lease_token,
            attempts.c.ended_at.is_(None),
        )
        .values(ended_at=func.clock_timestamp(), result=result, detail=detail)
    )
    told = select(moved.c.id, literal(str(to)), cast(dict(data), JSONB))
    recorded = insert(events).from_select(["job_id", "kind", "data"], told)
    return select(moved.c.id).add_cte(
        released.cte("released"), ended.cte("ended"), recorded.cte("recorded")
    )
