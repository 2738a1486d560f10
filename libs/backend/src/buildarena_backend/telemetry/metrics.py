"""Metrics of the whole service, for monitoring: read from the jobs' rows, so never lost."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import ARRAY, ColumnElement, Connection, Double, Row, case, cast, func, select, text

from buildarena_backend import events
from buildarena_backend.database.database import Database
from buildarena_backend.database.tables import attempts, jobs, sweeps, verifications
from buildarena_backend.states import Audit, JobState, Outcome, SweepState, Verdict

STAGE_SECONDS = (0.05, 0.1, 0.25, 0.5, 1, 2.5, 5, 10, 30, 60, 120, 300, 600, 1800, 3600)
"""Bounds of the classes of stage durations, in seconds; each class has its lower bound in it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MetricValues:
    """All of them, from one moment.

    Attributes:
        jobs: Jobs by state, stage, outcome and reason of their error; empty where there is none.
        queues: ``jobs`` that wait in each ``queue``, and the wait of the oldest.
        models: Requests, tokens and dollars of each model's sessions.
        stages: Durations of attempts by stage and result: counts per class of STAGE_SECONDS, the
            last above all of them, and the sum of seconds.
        running: Jobs that are worked on, by queue.
        verifications: Ended verifications by verdict.
        audits: Jobs by state of their audit; those that need none are left out.
    """

    jobs: Mapping[tuple[str, str, str, str], int]
    queues: Sequence[Row[Any]]
    models: Mapping[str, Mapping[str, Any]]
    stages: Mapping[tuple[str, str], tuple[Sequence[int], float]]
    sweeps: dict[str, int]
    running: dict[str, int]
    verifications: dict[str, int]
    audits: dict[str, int]


class Metrics:
    """Reads the service's figures; each read counts over all jobs, so callers cache the result."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def read(self) -> MetricValues:
        """Return all figures."""
        with self._database.transaction() as connection:
            connection.execute(text("SET TRANSACTION ISOLATION LEVEL REPEATABLE READ READ ONLY"))
            places, used, audits = _count_jobs(connection)
            return MetricValues(
                jobs=places,
                queues=_queues(connection),
                models=used,
                stages=_stages(connection),
                sweeps=dict.fromkeys(map(str, SweepState), 0) | _count(connection, sweeps.c.state),
                running=_count(connection, jobs.c.queue, jobs.c.state == JobState.RUNNING),
                verifications=dict.fromkeys(map(str, Verdict), 0)
                | _count(connection, verifications.c.verdict, verifications.c.verdict.is_not(None)),
                audits=audits,
            )


def _count_jobs(
    connection: Connection,
) -> tuple[Counter[tuple[str, str, str, str]], dict[str, Counter[str]], Counter[str]]:
    """Return jobs by stage, use by model and jobs by audit, by one query."""
    place = (
        jobs.c.state,
        jobs.c.stage,
        func.coalesce(jobs.c.outcome, "").label("outcome"),
        case((jobs.c.outcome == Outcome.ERRORED, func.coalesce(jobs.c.reason, "")), else_="").label(
            "reason"
        ),
    )
    use = [jobs.c[name] for name in ("requests", "input_tokens", "output_tokens", "cost_usd")]
    columns = (*place, jobs.c.model, jobs.c.audit)
    query = select(
        *columns, func.count().label("jobs"), *(func.sum(item).label(item.name) for item in use)
    ).group_by(*columns)
    places: Counter[tuple[str, str, str, str]] = Counter()
    audits: Counter[str] = Counter(dict.fromkeys(map(str, Audit), 0))
    used: dict[str, Counter[str]] = {}
    for row in connection.execute(query):
        places[row.state, row.stage, row.outcome, row.reason] += row.jobs
        used.setdefault(row.model, Counter()).update({c.name: getattr(row, c.name) for c in use})
        if row.audit is not None:
            audits[row.audit] += row.jobs
    return places, used, audits


def _queues(connection: Connection) -> Sequence[Row[Any]]:
    waited = func.extract("epoch", events.now - func.min(jobs.c.available_at))
    query = (
        select(
            jobs.c.queue,
            func.count().label("jobs"),
            cast(func.greatest(waited, 0), Double).label("oldest_s"),
        )
        .where(jobs.c.state == JobState.QUEUED)
        .group_by(jobs.c.queue)
        .order_by(jobs.c.queue)
    )
    return connection.execute(query).all()


def _stages(connection: Connection) -> dict[tuple[str, str], tuple[list[int], float]]:
    seconds = func.extract("epoch", attempts.c.ended_at - attempts.c.started_at)
    columns = (
        attempts.c.stage,
        attempts.c.result,
        func.width_bucket(
            cast(seconds, Double), cast([*map(float, STAGE_SECONDS)], ARRAY(Double))
        ).label("bucket"),
    )
    query = (
        select(*columns, func.count().label("attempts"), func.sum(seconds).label("seconds"))
        .where(attempts.c.ended_at.is_not(None))
        .group_by(*columns)
    )
    times: dict[tuple[str, str], tuple[list[int], float]] = {}
    for row in connection.execute(query):
        counts, total = times.get((row.stage, row.result), ([0] * (len(STAGE_SECONDS) + 1), 0.0))
        counts[row.bucket] += row.attempts
        times[row.stage, row.result] = (counts, total + float(row.seconds))
    return times


def _count(
    connection: Connection, column: ColumnElement[str], *conditions: ColumnElement[bool]
) -> dict[str, int]:
    query = select(column, func.count()).where(*conditions).group_by(column)
    return {row[0]: row[1] for row in connection.execute(query)}
