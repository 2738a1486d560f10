"""Pages of jobs: which, in which order, and where the page before ended."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from decimal import Decimal
from types import MappingProxyType
from typing import Any, Final, Literal

from sqlalchemy import ColumnElement, Select, and_, case, or_, select

from buildarena_store.ids import begins_with
from buildarena_store.jobs.job import JOB_COLUMNS, Job
from buildarena_store.states import EXTERNAL_PROVIDER
from buildarena_store.tables import jobs, sweep_jobs

Sort = Literal["created", "finished", "indicator", "cost", "task", "model", "seed"]
SortValue = datetime | float | Decimal | str | int | None

_UNKNOWN_COST: Final = jobs.c.model_config["provider"].astext == EXTERNAL_PROVIDER
_COLUMNS: Final[Mapping[Sort, ColumnElement[Any]]] = MappingProxyType(
    {
        "created": jobs.c.created_at,
        "finished": jobs.c.finished_at,
        "indicator": jobs.c.indicator,
        # What nobody counted is no cost of 0.
        "cost": case((_UNKNOWN_COST, None), else_=jobs.c.cost_usd),
        "task": jobs.c.task,
        "model": jobs.c.model,
        "seed": jobs.c.seed,
    }
)
NULLABLE: Final[frozenset[Sort]] = frozenset({"finished", "indicator", "cost"})
"""What a job may lack; those that do come last, in both directions."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """An order of jobs; equal ones are in the order of their ids.

    Attributes:
        by: What they are sorted by.
        descending: Whether the greatest, or newest, comes first.
    """

    by: Sort = "created"
    descending: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class JobFilter:
    """Which jobs are meant; None means any.

    Attributes:
        sweep_id: Only this sweep's jobs.
        flag: Only jobs with this flag.
        id_prefix: Only jobs whose id begins like this.
        indicator_min: Only jobs with this indicator or a greater one.
        indicator_max: Only jobs with this indicator or a smaller one.
        text: Only jobs in whose id, task, model, reason or detail it stands, in any case.
        since: Only jobs that ended then or later.
        until: Only jobs that ended before.
        equals: Column values to match.
    """

    sweep_id: str | None = None
    flag: str | None = None
    id_prefix: str | None = None
    indicator_min: float | None = None
    indicator_max: float | None = None
    text: str | None = None
    since: datetime | None = None
    until: datetime | None = None
    equals: Mapping[str, str | int | None] = field(default_factory=dict)


def sort_value(job: Job, by: Sort) -> SortValue:
    """What a job is sorted by."""
    values: dict[Sort, SortValue] = {
        "created": job.created_at,
        "finished": job.finished_at,
        "indicator": job.indicator,
        "cost": job.cost_usd if job.usage_is_known else None,
        "task": job.task,
        "model": job.model,
        "seed": job.seed,
    }
    return values[by]


def page_query(
    wanted: JobFilter, order: Order, after: tuple[SortValue, str] | None, limit: int
) -> Select[Any]:
    """The query for a page.

    Args:
        wanted: Which jobs.
        order: In which order.
        after: What the last job of the page before is sorted by, and its id.
        limit: Rows at most.
    """
    query = select(*JOB_COLUMNS).where(*_conditions(wanted))
    if wanted.sweep_id is not None:
        query = query.join(sweep_jobs, sweep_jobs.c.job_id == jobs.c.id).where(
            sweep_jobs.c.sweep_id == wanted.sweep_id
        )
    if after is not None:
        query = query.where(_behind(order, *after))
    column = _COLUMNS[order.by]
    sorted_ = column.desc() if order.descending else column.asc()
    if order.by in NULLABLE:
        sorted_ = sorted_.nulls_last()
    return query.order_by(sorted_, jobs.c.id).limit(limit)


def _conditions(wanted: JobFilter) -> list[ColumnElement[bool]]:
    found = [jobs.c[name] == value for name, value in wanted.equals.items() if value is not None]
    if wanted.flag is not None:
        found.append(jobs.c.flags.contains([wanted.flag]))
    if wanted.id_prefix is not None:
        found.append(begins_with(jobs.c.id, wanted.id_prefix))
    if wanted.indicator_min is not None:
        found.append(jobs.c.indicator >= wanted.indicator_min)
    if wanted.indicator_max is not None:
        found.append(jobs.c.indicator <= wanted.indicator_max)
    if wanted.since is not None:
        found.append(jobs.c.finished_at >= wanted.since)
    if wanted.until is not None:
        found.append(jobs.c.finished_at < wanted.until)
    if wanted.text is not None:
        columns = (jobs.c[name] for name in ("id", "task", "model", "reason", "detail"))
        found.append(or_(*(column.icontains(wanted.text, autoescape=True) for column in columns)))
    return found


def _behind(order: Order, value: SortValue, id_: str) -> ColumnElement[bool]:
    column = _COLUMNS[order.by]
    if value is None:
        return and_(column.is_(None), jobs.c.id > id_)
    further = column < value if order.descending else column > value
    behind = or_(further, and_(column == value, jobs.c.id > id_))
    return or_(behind, column.is_(None)) if order.by in NULLABLE else behind
