"""Sweeps: submitted matrices of jobs. Jobs are shared: two sweeps that want one job get one."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import datetime
from decimal import Decimal
from typing import Any, Final

from cachetools import TTLCache
from sqlalchemy import Connection, Row, case, exists, func, literal, select, text
from sqlalchemy.dialects.postgresql import insert

from buildarena_backend import events
from buildarena_backend.accounts.budgets import Budget
from buildarena_backend.database.account_tables import NEEDS_BUDGET
from buildarena_backend.database.database import Database
from buildarena_backend.database.rows import bound_texts, columns_of, value_of
from buildarena_backend.database.tables import attempts, jobs, sweep_jobs, sweeps
from buildarena_backend.errors import UnknownIdError
from buildarena_backend.ids import begins_with
from buildarena_backend.states import AttemptResult, JobState, SweepState
from buildarena_backend.sweeps.forecasts import Forecast, read_forecast

LARGE: Final = 2000
"""Jobs of a sweep whose progress is not counted again for every request."""
COUNTED_EVERY_S: Final = 15.0


@dataclass(frozen=True, slots=True, kw_only=True)
class NewSweep:
    """A sweep to be stored.

    Attributes:
        owner: Id of the API key that submitted it, if any.
        request_hash: Content hash of the submission.
        jobs_hash: Content hash of its jobs' ids.
    """

    id: str
    name: str
    spec: Mapping[str, Any]
    owner: str | None = None
    request_hash: str | None = None
    jobs_hash: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep(NewSweep):
    """A sweep's row."""

    state: str
    created_at: datetime


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepProgress:
    """Progress of a sweep.

    Attributes:
        stages: Jobs that have not ended, by ``construct queued`` … ``simulate running``.
        outcomes: Ended jobs by outcome.
        requests: Model requests so far.
        lost_requests: Requests whose replies may have been paid for and are in no journal: at most
            one for each process that was killed in a session.
        input_tokens: Tokens sent so far.
        output_tokens: Tokens received so far.
    """

    total: int
    stages: Mapping[str, int]
    outcomes: Mapping[str, int]
    cost_usd: Decimal
    requests: int
    lost_requests: int
    input_tokens: int
    output_tokens: int

    @property
    def done(self) -> int:
        """Jobs that have ended, with any outcome."""
        return sum(self.outcomes.values())

    @property
    def usage(self) -> SweepProgress:
        """Resources used, under the fields of `Usage`."""
        return self


class Sweeps:
    """Adds and finds sweeps."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self._large: TTLCache[str, SweepProgress] = TTLCache(1000, COUNTED_EVERY_S)

    def add(self, sweep: NewSweep, job_ids: Sequence[str], *, connection: Connection) -> None:
        """Store a sweep with its jobs, which exist already."""
        connection.execute(insert(sweeps).values(state=SweepState.ACTIVE, **asdict(sweep)))
        members = select(literal(sweep.id), func.unnest(bound_texts(sorted(job_ids))))
        connection.execute(insert(sweep_jobs).from_select(["sweep_id", "job_id"], members))
        events.record_sweep(connection, sweep.id, "submitted", {"jobs": len(job_ids)})

    def get(self, sweep_id: str) -> Sweep:
        """Return the sweep with this id.

        Raises:
            UnknownIdError: The sweep does not exist.
        """
        sweep = self.find(sweep_id)
        if sweep is None:
            raise UnknownIdError("sweep", sweep_id)
        return sweep

    def find(self, sweep_id: str) -> Sweep | None:
        """Return the sweep with this id, or None."""
        row = self._database.first_row(select(*_COLUMNS).where(sweeps.c.id == sweep_id))
        return None if row is None else value_of(Sweep, row)

    def with_jobs(self, jobs_hash: str, *, owner: str | None, connection: Connection) -> str | None:
        """Return the id of an owner's newest uncancelled sweep of just these jobs, if any.

        In a transaction of `SweepLifecycle.command` the result holds until its end: one that finds
        no sweep can store one, and it stays the only one.
        """
        query = (
            select(sweeps.c.id)
            .where(
                sweeps.c.jobs_hash == jobs_hash,
                sweeps.c.owner.is_not_distinct_from(owner),
                sweeps.c.state != SweepState.CANCELLED,
            )
            .order_by(sweeps.c.created_at.desc())
            .limit(1)
        )
        sweep_id: str | None = connection.execute(query).scalar()
        return sweep_id

    def page(
        self,
        *,
        limit: int,
        after: tuple[datetime, str] | None = None,
        id_prefix: str | None = None,
        names: Sequence[str] | None = None,
        states: Sequence[SweepState] | None = None,
        owners: Sequence[str] | None = None,
    ) -> list[Sweep]:
        """Return the newest sweeps first, with keyset paging and beginnings of ids as for jobs."""
        query = select(*_COLUMNS).order_by(sweeps.c.created_at.desc(), sweeps.c.id).limit(limit)
        if id_prefix is not None:
            query = query.where(begins_with(sweeps.c.id, id_prefix))
        if names is not None:
            query = query.where(sweeps.c.name == func.any(bound_texts(names)))
        if owners is not None:
            query = query.where(sweeps.c.owner == func.any(bound_texts(owners)))
        if states is not None:
            query = query.where(_SHOWN_STATE.in_(states))
        if after is not None:
            created_at, id_ = after
            query = query.where(
                (sweeps.c.created_at < created_at)
                | ((sweeps.c.created_at == created_at) & (sweeps.c.id > id_))
            )
        return [value_of(Sweep, row) for row in self._database.all_rows(query)]

    def progress(self, sweep_id: str) -> SweepProgress:
        """Return the states of a sweep's jobs, and their cost."""
        return self.progress_of([sweep_id])[sweep_id]

    def progress_of(self, ids: Sequence[str]) -> dict[str, SweepProgress]:
        """Return the same of several sweeps, by id; of a large one as it was some seconds ago."""
        cached = {id_: progress for id_ in ids if (progress := self._large.get(id_)) is not None}
        rows: dict[str, list[Row[Any]]] = {id_: [] for id_ in ids if id_ not in cached}
        place = (sweep_jobs.c.sweep_id, jobs.c.stage, jobs.c.state, jobs.c.outcome)
        query = (
            select(
                *place,
                func.count().label("jobs"),
                *(func.sum(case((NEEDS_BUDGET, jobs.c[n]), else_=0)).label(n) for n in _USE),
            )
            .join(jobs, jobs.c.id == sweep_jobs.c.job_id)
            .where(sweep_jobs.c.sweep_id == func.any(bound_texts(list(rows))))
            .group_by(*place)
        )
        if rows:
            for row in self._database.all_rows(query):
                rows[row.sweep_id].append(row)
        counted = {id_: _progress(sweep_rows) for id_, sweep_rows in rows.items()}
        self._large.update({id_: new for id_, new in counted.items() if new.total > LARGE})
        return cached | counted

    def forecast(self, sweep_id: str, budget: Budget | None) -> Forecast:
        """Return a forecast of a sweep's end and cost, from its jobs so far.

        Raises:
            UnknownIdError: The sweep does not exist.
        """
        state, spent_usd = self.get(sweep_id).state, self.progress(sweep_id).cost_usd
        left_usd = None
        if budget is not None and budget.max_cost_usd is not None:
            left_usd = budget.max_cost_usd - budget.spent_cost_usd
        with self._database.transaction() as connection:
            return read_forecast(
                connection, sweep_id, state=state, spent_usd=spent_usd, own_budget_usd=left_usd
            )

    def faults(self, sweep_id: str, *, limit: int) -> Sequence[Row[Any]]:
        """Return failed attempts and slow or repeated requests of the sweep's jobs, newest first.

        Those of a model, stage, result and detail are one row, with how many ``attempts`` there
        were, of how many ``jobs``, and when the ``newest`` ended.

        Args:
            limit: Kinds of fault at most.
        """
        newest = func.max(attempts.c.ended_at)
        alike = jobs.c.model, attempts.c.stage, attempts.c.result, attempts.c.detail
        query = (
            select(
                *alike,
                func.count().label("attempts"),
                func.count(jobs.c.id.distinct()).label("jobs"),
                newest.label("newest"),
            )
            .join(jobs, jobs.c.id == attempts.c.job_id)
            .join(sweep_jobs, sweep_jobs.c.job_id == attempts.c.job_id)
            .where(
                sweep_jobs.c.sweep_id == sweep_id,
                attempts.c.result.in_([AttemptResult.FAULT, AttemptResult.LOST]),
            )
            .group_by(*alike)
            .order_by(newest.desc(), *alike)
            .limit(limit)
        )
        values = {"sweep": sweep_id, "limit": limit}
        with self._database.transaction() as connection:
            return [*connection.execute(query), *connection.execute(_REQUESTS, values)]

    def size(self, sweep_id: str) -> int:
        """Return the number of the sweep's jobs.

        Raises:
            UnknownIdError: The sweep does not exist.
        """
        self.get(sweep_id)
        query = (
            select(func.count()).select_from(sweep_jobs).where(sweep_jobs.c.sweep_id == sweep_id)
        )
        return int(self._database.first_value(query))

    def job_ids(self, sweep_id: str) -> list[str]:
        """Return the ids of all the sweep's jobs."""
        query = select(sweep_jobs.c.job_id).where(sweep_jobs.c.sweep_id == sweep_id)
        return [row.job_id for row in self._database.all_rows(query)]


_REQUESTS: Final = text(
    """
    WITH members AS (
        SELECT jobs.* FROM sweep_jobs JOIN jobs ON jobs.id = job_id WHERE sweep_id = :sweep
    )
    (SELECT model, 'construct' AS stage, 'waiting' AS result, NULL AS detail,
        count(*) AS attempts, count(*) AS jobs, min(since) AS newest
    FROM members, LATERAL (
        SELECT greatest(max(journal.created_at), members.started_at, max(attempts.started_at))
        FROM attempts LEFT JOIN journal USING (job_id) WHERE attempts.job_id = members.id
    ) AS last (since)
    WHERE state = 'running' AND stage = 'construct' AND since < now() - interval '1 minute'
    GROUP BY model)
    UNION ALL
    (SELECT model, 'construct', 'retried', failure, count(*), count(DISTINCT members.id),
        max(journal.created_at)
    FROM members JOIN journal ON journal.job_id = members.id,
        LATERAL jsonb_array_elements_text(journal.failures) AS failure
    GROUP BY model, failure ORDER BY count(*) DESC LIMIT :limit)
    """
)
"""Requests that have had no answer for a minute, and those that were sent again, alike ones."""
_OPEN: Final = exists().where(
    sweep_jobs.c.sweep_id == sweeps.c.id,
    jobs.c.id == sweep_jobs.c.job_id,
    jobs.c.state != JobState.DONE,
)
_SHOWN_STATE: Final = case(
    ((sweeps.c.state == SweepState.ACTIVE) & ~_OPEN, SweepState.DONE.value), else_=sweeps.c.state
)
_USE: Final = ("requests", "lost_requests", "input_tokens", "output_tokens", "cost_usd")


def _progress(rows: Sequence[Row[Any]]) -> SweepProgress:
    stages: Counter[str] = Counter()
    outcomes: Counter[str] = Counter()
    for row in rows:
        if row.state == JobState.DONE:
            outcomes[row.outcome] += row.jobs
        else:
            stages[f"{row.stage} {row.state}"] += row.jobs
    used = {name: sum(getattr(row, name) for row in rows) for name in _USE}
    return SweepProgress(
        total=stages.total() + outcomes.total(),
        stages=stages,
        outcomes=outcomes,
        cost_usd=Decimal(used.pop("cost_usd")),
        **{name: int(number) for name, number in used.items()},
    )


_COLUMNS = columns_of(Sweep, sweeps)
