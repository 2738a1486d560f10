"""Forecasts of the end and the cost of sweeps, from their jobs so far."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime, timedelta
from decimal import Decimal
from typing import Final

from pydantic import with_config
from sqlalchemy import Connection, TextClause, func, or_, select, text

from buildarena_backend.database.tables import events, jobs, sweep_jobs
from buildarena_backend.events import now
from buildarena_backend.states import JobState, Outcome, Stage, SweepState

UNSCORED: Final = (Outcome.ERRORED, Outcome.CANCELLED)
"""Outcomes that predict neither the duration nor the cost of other jobs."""
RATE_OVER: Final = 100
"""Scored jobs that a rate is taken over: one more that ends moves it by a hundredth."""
FEWEST: Final = 5
"""Minimum of scored jobs for a rate."""


@with_config(use_attribute_docstrings=True)
@dataclass(frozen=True, slots=True, kw_only=True)
class Forecast:
    """Forecast of a sweep from its finished jobs."""

    remaining_jobs: int
    """Jobs that have not ended."""
    jobs_per_minute: float | None
    """Rate of scoring over the last hundred jobs; null until five were scored, and unless the sweep
    is active."""
    finish_at: datetime | None
    """End of the last job at that rate."""
    remaining_cost_usd: float
    """Expected cost of the remaining jobs, by the mean cost of the same model on the same task, or
    on other tasks."""
    total_cost_usd: float
    """The same with what was used."""
    lacking_budget_usd: float | None
    """Dollars that the budget lacks for that; null without a limit in dollars, 0 if it is
    enough."""
    unknown_models: list[str]
    """Models of which no job has been scored yet: the costs leave them out."""


def read_forecast(
    connection: Connection,
    sweep_id: str,
    *,
    state: str,
    spent_usd: Decimal,
    own_budget_usd: Decimal | None,
) -> Forecast:
    """Return a sweep's forecast, from its jobs that have ended.

    Args:
        state: Its state; only an active one has a rate.
        spent_usd: Cost of its jobs so far.
        own_budget_usd: What its budget has left; None without a limit.
    """
    values = {"sweep": sweep_id, "done": JobState.DONE, "unscored": list(UNSCORED)}
    rows = connection.execute(_COSTS, values).all()
    left = sum(row.jobs for row in rows)
    cost = sum((row.cost for row in rows if row.known), Decimal())
    own_cost = sum((row.own_cost for row in rows if row.known), Decimal())
    per_minute, at = None, None
    if state == SweepState.ACTIVE and left:
        per_minute, at = _rate(connection, sweep_id)
    short = None if own_budget_usd is None else float(max(Decimal(), own_cost - own_budget_usd))
    return Forecast(
        remaining_jobs=left,
        jobs_per_minute=per_minute,
        finish_at=None if per_minute is None or at is None else _end(at, left / per_minute),
        remaining_cost_usd=float(cost),
        total_cost_usd=float(spent_usd + cost),
        lacking_budget_usd=short,
        unknown_models=[row.model for row in rows if not row.known],
    )


def _rate(connection: Connection, sweep_id: str) -> tuple[float | None, datetime]:
    """Return the jobs that are scored in a minute, up to this moment, and the moment.

    A sweep that is stuck slows down, though nothing ends; what ended before it was submitted or
    last resumed does not count. The rate is None while trials wait and only jobs without one ended.
    """
    started = select(func.max(events.c.at)).where(
        events.c.sweep_id == sweep_id,
        or_(events.c.kind == "submitted", events.c.kind == SweepState.ACTIVE),
    )
    since: datetime | None
    moment, since = connection.execute(select(now, started.scalar_subquery())).one()
    if since is None:
        return None, moment
    ends = (
        select(jobs.c.finished_at)
        .join(sweep_jobs, sweep_jobs.c.job_id == jobs.c.id)
        .where(
            sweep_jobs.c.sweep_id == sweep_id,
            jobs.c.finished_at > since,
            jobs.c.outcome.not_in(UNSCORED),
        )
        .order_by(jobs.c.finished_at.desc())
        .limit(RATE_OVER + 1)
    )
    times = list(connection.execute(ends).scalars())
    trials = ends.where(jobs.c.outcome != Outcome.CONSTRUCTION_FAILED).limit(FEWEST)
    waiting = (
        select(jobs.c.id)
        .join(sweep_jobs, sweep_jobs.c.job_id == jobs.c.id)
        .where(
            sweep_jobs.c.sweep_id == sweep_id,
            jobs.c.state != JobState.DONE,
            jobs.c.stage == Stage.SIMULATE,
        )
        .limit(1)
    )
    ended = len(connection.execute(trials).all())
    if len(times) < FEWEST or (ended < FEWEST and connection.execute(waiting).first()):
        return None, moment
    begin = times[RATE_OVER] if len(times) > RATE_OVER else since
    minutes = max((moment - begin).total_seconds(), 1.0) / 60
    return min(len(times), RATE_OVER) / minutes, moment


def _end(moment: datetime, minutes: float) -> datetime | None:
    """Return the time after some minutes; None beyond the calendar's range."""
    try:
        return moment + timedelta(minutes=minutes)
    except OverflowError:
        return None


_COSTS: Final[TextClause] = text(
    """
    WITH members AS (
        SELECT jobs.* FROM jobs JOIN sweep_jobs ON sweep_jobs.job_id = jobs.id
        WHERE sweep_jobs.sweep_id = :sweep AND sweep_jobs.claimed
    ),
    means AS (
        SELECT model, task, avg(cost_usd) AS mean FROM members
        WHERE state = :done AND outcome <> ALL(:unscored)
        GROUP BY GROUPING SETS ((model, task), (model))
    )
    SELECT members.model, count(*) AS jobs, bool_or(of_model.mean IS NOT NULL) AS known,
        coalesce(sum(greatest(
            coalesce(on_task.mean, of_model.mean) - members.cost_usd, 0)), 0) AS cost,
        coalesce(sum(greatest(
            coalesce(on_task.mean, of_model.mean) - members.cost_usd, 0)
        ) FILTER (WHERE members.payer = :sweep), 0) AS own_cost
    FROM members
    LEFT JOIN means AS on_task
        ON on_task.model = members.model AND on_task.task = members.task
    LEFT JOIN means AS of_model ON of_model.model = members.model AND of_model.task IS NULL
    WHERE members.state <> :done
    GROUP BY members.model ORDER BY members.model
    """
)
