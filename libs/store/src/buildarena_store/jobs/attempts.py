"""Attempts: one worker's work on one stage of a job, and how it ended."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import Connection, text

from buildarena_store.states import AttemptResult, JobState


@dataclass(frozen=True, slots=True, kw_only=True)
class Attempt:
    """One worker's attempt at a job's stage: who, when, and how it ended."""

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
        job_id: The job.
        token: The fencing token of the attempt's lease.
        state: The job's state from now on.
        data: What its listeners are sent with the new state.
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
    """Ends attempts: releases what was reserved for their requests and records the jobs' states.

    Args:
        endings: The attempts; a job that nobody was working on just gets its event.
        result: How they ended.
        detail: A sentence for people.
        connection: The transaction that also moved the jobs.
    """
    if not endings:
        return
    given = {
        "job_ids": [ending.job_id for ending in endings],
        "tokens": [ending.token for ending in endings],
        "states": [str(ending.state) for ending in endings],
        "data": [json.dumps(dict(ending.data)) for ending in endings],
        "result": str(result),
        "detail": detail,
    }
    connection.execute(_END, given)
