"""Metrics of the whole service, for monitoring: read from what the jobs say, so never lost."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Final

from sqlalchemy import Connection, func, select, text

from buildarena_backend import events
from buildarena_backend.database.database import Database
from buildarena_backend.database.derived_tables import OF_A_SWEEP, kept_figures
from buildarena_backend.database.tables import jobs, sweeps
from buildarena_backend.states import Audit, JobState, SweepState, Verdict
from buildarena_backend.telemetry.server_figures import ServerFigures, read_server

GATHER_LOCK: Final = 0x636F756E74  # "count": one process at a time adds changes to the counts
STAGE_SECONDS = (0.05, 0.1, 0.25, 0.5, 1, 2.5, 5, 10, 30, 60, 120, 300, 600, 1800, 3600)
"""Bounds of the classes of stage durations, in seconds; each class has its lower bound in it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JobCount:
    """How many jobs are, or once were, in one place; fields are a job's, empty where null."""

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

    @classmethod
    def none(cls, model: str) -> ModelUse:
        """Of a model that was not asked yet."""
        return cls(model=model, requests=0, input_tokens=0, output_tokens=0, cost_usd=0.0)


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
class MetricValues:
    """All of them, from one moment.

    Attributes:
        jobs: Jobs by where they are.
        queues: What waits.
        models: What sessions used.
        stages: How long attempts took.
        sweeps: Sweeps by state.
        running: Jobs that are worked on, by queue.
        verifications: Ended verifications by verdict.
        audits: Jobs by where their audit stands; those that need none are left out.
        server: The Postgres server's own.
    """

    jobs: Sequence[JobCount]
    queues: Sequence[QueueDepth]
    models: Sequence[ModelUse]
    stages: Sequence[StageTimes]
    sweeps: dict[str, int]
    running: dict[str, int]
    verifications: dict[str, int]
    audits: dict[str, int]
    server: ServerFigures


class Metrics:
    """Reads the service's figures, which triggers keep: nothing is counted over all jobs."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def read(self) -> MetricValues:
        """All figures."""
        self.gather()
        with self._database.transaction() as connection:
            connection.execute(text("SET TRANSACTION ISOLATION LEVEL REPEATABLE READ READ ONLY"))
            kept = _Stored.read(connection)
            return MetricValues(
                jobs=_jobs(kept),
                queues=_queues(connection, kept),
                models=_models(kept),
                stages=_stages(kept),
                sweeps=_sweeps(connection),
                running=_running(connection),
                verifications=_by_state(kept, "verifications", Verdict),
                audits=_by_state(kept, "audits", Audit),
                server=read_server(connection),
            )

    def gather(self) -> None:
        """Adds what changed to the counts; when another process is about it, that one does."""
        with self._database.transaction() as connection:
            if connection.execute(select(func.pg_try_advisory_xact_lock(GATHER_LOCK))).scalar():
                connection.execute(_GATHER)


_GATHER: Final = text(
    """
    WITH gone AS (DELETE FROM figure_changes RETURNING *)
    INSERT INTO figures (kind, key, a, b, c, d)
    SELECT kind, key, sum(a), sum(b), sum(c), sum(d) FROM gone GROUP BY kind, key
    ON CONFLICT (kind, key) DO UPDATE SET a = figures.a + excluded.a, b = figures.b + excluded.b,
        c = figures.c + excluded.c, d = figures.d + excluded.d
    """
)
_STORED: Final = kept_figures(f"NOT {OF_A_SWEEP}")

Amounts = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class _Stored:
    """Kept figures by what they are of."""

    by_kind: Mapping[str, Sequence[tuple[Sequence[Any], Amounts]]]

    @staticmethod
    def read(connection: Connection) -> _Stored:
        found: dict[str, list[tuple[Sequence[Any], Amounts]]] = {}
        for row in connection.execute(_STORED):
            amounts = float(row.a), float(row.b), float(row.c), float(row.d)
            found.setdefault(row.kind, []).append((row.key, amounts))
        return _Stored(found)

    def of(self, kind: str) -> Sequence[tuple[Sequence[Any], Amounts]]:
        return self.by_kind.get(kind, ())


def _jobs(kept: _Stored) -> list[JobCount]:
    counts: Counter[tuple[str, str, str, str]] = Counter()
    for (state, stage, outcome, reason, _), amounts in kept.of("jobs"):
        counts[state, stage, outcome, reason] += int(amounts[0])
    return [
        JobCount(state=state, stage=stage, outcome=outcome, reason=reason, jobs=number)
        for (state, stage, outcome, reason), number in counts.items()
    ]


def _queues(connection: Connection, kept: _Stored) -> list[QueueDepth]:
    depths: Counter[str] = Counter()
    for (state, _, _, _, queue), amounts in kept.of("jobs"):
        if state == JobState.QUEUED:
            depths[queue] += int(amounts[0])
    found = []
    for queue, number in sorted(depths.items()):
        oldest = select(func.min(jobs.c.available_at)).where(
            jobs.c.state == JobState.QUEUED, jobs.c.queue == queue
        )
        waited = func.greatest(func.extract("epoch", events.now - oldest.scalar_subquery()), 0)
        oldest_s = connection.execute(select(waited)).scalar()
        if number:
            found.append(QueueDepth(queue=queue, jobs=number, oldest_s=float(oldest_s or 0.0)))
    return found


def _models(kept: _Stored) -> list[ModelUse]:
    return [
        ModelUse(
            model=model,
            requests=int(requests),
            input_tokens=int(input_tokens),
            output_tokens=int(output_tokens),
            cost_usd=cost_usd,
        )
        for (model,), (requests, input_tokens, output_tokens, cost_usd) in kept.of("models")
    ]


def _stages(kept: _Stored) -> list[StageTimes]:
    found: dict[tuple[str, str], tuple[list[int], float]] = {}
    for (stage, result, number), (attempts, seconds, _, _) in kept.of("stages"):
        counts, total = found.get((stage, result), ([0] * (len(STAGE_SECONDS) + 1), 0.0))
        counts[number] += int(attempts)
        found[stage, result] = (counts, total + seconds)
    return [
        StageTimes(stage=stage, result=result, counts=counts, total_s=total)
        for (stage, result), (counts, total) in sorted(found.items())
    ]


def _by_state(kept: _Stored, kind: str, states: type[StrEnum]) -> dict[str, int]:
    """Counts by state, also of states that nothing is in."""
    counts = {str(state): 0 for state in states}
    return counts | {state: int(amounts[0]) for (state,), amounts in kept.of(kind)}


def _sweeps(connection: Connection) -> dict[str, int]:
    query = select(sweeps.c.state, func.count().label("sweeps")).group_by(sweeps.c.state)
    found = {row.state: row.sweeps for row in connection.execute(query)}
    return {str(state): 0 for state in SweepState} | found


def _running(connection: Connection) -> dict[str, int]:
    query = (
        select(jobs.c.queue, func.count().label("jobs"))
        .where(jobs.c.state == JobState.RUNNING)
        .group_by(jobs.c.queue)
    )
    return {row.queue: row.jobs for row in connection.execute(query)}
