"""Figures of the whole service, for monitoring: read from what the jobs say, so never lost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from sqlalchemy import ARRAY, Connection, Double, case, cast, func, select, text

from buildarena_store import events
from buildarena_store.database import Database
from buildarena_store.states import JobState, Outcome
from buildarena_store.tables import attempts, jobs, sweeps

STAGE_SECONDS = (0.05, 0.1, 0.25, 0.5, 1, 2.5, 5, 10, 30, 60, 120, 300, 600, 1800, 3600)
"""Bounds of the classes of stage durations, in seconds; each class has its lower bound in it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JobCount:
    """How many jobs are in one place; fields are those of a job, empty where they are null."""

    state: str
    stage: str
    outcome: str
    reason: str
    jobs: int


@dataclass(frozen=True, slots=True, kw_only=True)
class QueueDepth:
    """What waits in a queue, and for how long the oldest has."""

    queue: str
    jobs: int
    oldest_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelUse:
    """What a model's sessions used so far."""

    model: str
    requests: int
    input_tokens: int
    output_tokens: int
    cost_usd: float


@dataclass(frozen=True, slots=True, kw_only=True)
class StageTimes:
    """How long attempts at jobs took.

    Attributes:
        stage: ``construct`` or ``simulate``.
        result: How they ended.
        counts: Attempts in each class of STAGE_SECONDS, and in the last those above all.
        total_s: Sum of their durations.
    """

    stage: str
    result: str
    counts: Sequence[int]
    total_s: float

    @classmethod
    def none(cls, stage: str, result: str) -> StageTimes:
        """No attempt of this stage that ended so."""
        return cls(stage=stage, result=result, counts=[0] * (len(STAGE_SECONDS) + 1), total_s=0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class ServiceFigures:
    """All of them, from one moment."""

    jobs: Sequence[JobCount]
    queues: Sequence[QueueDepth]
    models: Sequence[ModelUse]
    stages: Sequence[StageTimes]
    sweeps: dict[str, int]
    running: dict[str, int]


class Figures:
    """Reads the service's figures."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def read(self) -> ServiceFigures:
        """All figures, consistent with each other."""
        with self._database.transaction() as connection:
            connection.execute(text("SET TRANSACTION ISOLATION LEVEL REPEATABLE READ READ ONLY"))
            return ServiceFigures(
                jobs=_jobs(connection),
                queues=_queues(connection),
                models=_models(connection),
                stages=_stages(connection),
                sweeps=_sweeps(connection),
                running=_running(connection),
            )


def _jobs(connection: Connection) -> list[JobCount]:
    errored = case((jobs.c.outcome == Outcome.ERRORED, func.coalesce(jobs.c.reason, "")), else_="")
    where = [
        jobs.c.state,
        jobs.c.stage,
        func.coalesce(jobs.c.outcome, "").label("outcome"),
        errored.label("reason"),
    ]
    rows = connection.execute(select(*where, func.count().label("jobs")).group_by(*where))
    return [JobCount(**row) for row in rows.mappings()]


def _queues(connection: Connection) -> list[QueueDepth]:
    waits = func.extract("epoch", events.now - func.min(jobs.c.available_at))
    query = (
        select(jobs.c.queue, func.count().label("jobs"), func.greatest(waits, 0).label("oldest_s"))
        .where(jobs.c.state == JobState.QUEUED)
        .group_by(jobs.c.queue)
    )
    return [
        QueueDepth(queue=row.queue, jobs=row.jobs, oldest_s=float(row.oldest_s))
        for row in connection.execute(query)
    ]


def _models(connection: Connection) -> list[ModelUse]:
    query = select(
        jobs.c.model,
        func.sum(jobs.c.requests).label("requests"),
        func.sum(jobs.c.input_tokens).label("input_tokens"),
        func.sum(jobs.c.output_tokens).label("output_tokens"),
        func.sum(jobs.c.cost_usd).label("cost_usd"),
    ).group_by(jobs.c.model)
    return [
        ModelUse(
            model=row.model,
            requests=int(row.requests),
            input_tokens=int(row.input_tokens),
            output_tokens=int(row.output_tokens),
            cost_usd=float(row.cost_usd),
        )
        for row in connection.execute(query)
    ]


def _stages(connection: Connection) -> list[StageTimes]:
    took = cast(func.extract("epoch", attempts.c.ended_at - attempts.c.started_at), Double)
    bounds = cast([float(bound) for bound in STAGE_SECONDS], ARRAY(Double))
    number = func.width_bucket(took, bounds).label("number")
    key = [attempts.c.stage, attempts.c.result]
    query = (
        select(*key, number, func.count().label("attempts"), func.sum(took).label("total_s"))
        .where(attempts.c.ended_at.is_not(None))
        .group_by(*key, number)
    )
    found: dict[tuple[str, str], tuple[list[int], float]] = {}
    for row in connection.execute(query):
        counts, total = found.get((row.stage, row.result), ([0] * (len(STAGE_SECONDS) + 1), 0.0))
        counts[row.number] = row.attempts
        found[row.stage, row.result] = (counts, total + row.total_s)
    return [
        StageTimes(stage=stage, result=result, counts=counts, total_s=total)
        for (stage, result), (counts, total) in sorted(found.items())
    ]


def _sweeps(connection: Connection) -> dict[str, int]:
    query = select(sweeps.c.state, func.count().label("sweeps")).group_by(sweeps.c.state)
    return {row.state: row.sweeps for row in connection.execute(query)}


def _running(connection: Connection) -> dict[str, int]:
    query = (
        select(jobs.c.queue, func.count().label("jobs"))
        .where(jobs.c.state == JobState.RUNNING)
        .group_by(jobs.c.queue)
    )
    return {row.queue: row.jobs for row in connection.execute(query)}
