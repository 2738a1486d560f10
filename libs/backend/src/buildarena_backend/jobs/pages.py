"""Pages of jobs: orders and cursors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from decimal import Decimal
from typing import Any, Final, Literal

from sqlalchemy import (
    ColumnElement,
    Connection,
    Row,
    Text,
    and_,
    func,
    literal_column,
    not_,
    or_,
    select,
)

from buildarena_backend.database.rows import bound_texts
from buildarena_backend.database.tables import jobs, sweep_jobs
from buildarena_backend.jobs.filters import (
    MAX_SORTED,
    JobFilter,
    conditions_but_text,
    conditions_of,
    ways_to_hold,
)
from buildarena_backend.jobs.job import JOB_COLUMNS, Job
from buildarena_backend.states import EXTERNAL_PROVIDER, JobState

Sort = Literal["created", "finished", "indicator", "cost"]
SortValue = datetime | float | Decimal | None

_COLUMNS: Final[Mapping[Sort, ColumnElement[Any]]] = {
    "created": jobs.c.created_at,
    "finished": jobs.c.finished_at,
    "indicator": jobs.c.indicator,
    "cost": jobs.c.cost_usd,
}
# Exactly the expression of the index of costs.
_ENDED: Final = jobs.c.state == literal_column(f"'{JobState.DONE}'", Text)
_COUNTED: Final = (
    func.coalesce(jobs.c.model_config["provider"].as_string(), "") != EXTERNAL_PROVIDER
)
_LACKING: Final[Mapping[Sort, ColumnElement[bool]]] = {
    "finished": jobs.c.finished_at.is_(None),
    "indicator": jobs.c.indicator.is_(None),
    # An unfinished job has no cost yet, and an uncounted cost is not a cost of 0.
    "cost": not_(and_(_ENDED, _COUNTED)),
}
"""Conditions by order for a missing figure. Those jobs come last, in both directions."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """An order of jobs; equal ones are in the order of their ids, in the same direction.

    Attributes:
        descending: Whether the greatest, or newest, comes first.
    """

    by: Sort = "created"
    descending: bool = True

    def sorted(self, *columns: ColumnElement[Any]) -> list[ColumnElement[Any]]:
        """Return the columns in this direction."""
        return [column.desc() if self.descending else column.asc() for column in columns]

    def after(self, column: ColumnElement[Any], value: Any) -> ColumnElement[bool]:
        """Return the condition for rows after a value."""
        condition: ColumnElement[bool] = column < value if self.descending else column > value
        return condition


def sort_value(job: Job, by: Sort) -> SortValue:
    """Return a job's sort value."""
    is_over = job.state == JobState.DONE
    values: dict[Sort, SortValue] = {
        "created": job.created_at,
        "finished": job.finished_at,
        "indicator": job.indicator,
        "cost": job.cost_usd if is_over and job.usage_is_known else None,
    }
    return values[by]


def read_page(
    connection: Connection,
    job_filter: JobFilter,
    order: Order,
    after: tuple[SortValue, str] | None,
    limit: int,
) -> list[Row[Any]]:
    """Return the rows of a page.

    Args:
        after: Sort key and id of the last row of the previous page.
    """
    states = job_filter.values("state")
    if states is not None and JobState.DONE not in states and order.by in _LACKING:
        # None of them has such a figure, and looking for one would take all of its index.
        among = conditions_of(connection, job_filter)
        are_few = _are_few(connection, job_filter, among)
        if after is not None:
            among.append(order.after(jobs.c.id, after[1]))
        return _first(connection, among, order.sorted(jobs.c.id), limit, are_few=are_few)
    conditions = conditions_but_text(job_filter)
    if job_filter.text is None:
        are_few = bool(conditions) and _are_few(connection, job_filter, conditions)
        return _read(connection, conditions, order, after, limit, are_few=are_few)
    # One way after another: all at once they have no index in common.
    ids = set[str]()
    for way in ways_to_hold(connection, job_filter.text):
        holding = [*conditions, way]
        are_few = _are_few(connection, job_filter, holding)
        rows = _read(connection, holding, order, after, limit, are_few=are_few)
        ids.update(row.id for row in rows)
    among = [jobs.c.id == func.any(bound_texts(sorted(ids)))]
    return _read(connection, among, order, None, limit, are_few=True)


def _read(
    connection: Connection,
    conditions: Sequence[ColumnElement[bool]],
    order: Order,
    after: tuple[SortValue, str] | None,
    limit: int,
    *,
    are_few: bool,
) -> list[Row[Any]]:
    """Return the page, from conditions.

    A second query reads those that lack the figure: so both can follow the one index of the order,
    in either direction.
    """
    column, lacking = _COLUMNS[order.by], _LACKING.get(order.by)
    value, last = after or (None, None)
    rows: list[Row[Any]] = []
    if after is None or value is not None:
        having = [*conditions] if lacking is None else [*conditions, not_(lacking)]
        if lacking is not None and order.by == "cost":
            having = [*conditions, _ENDED, _COUNTED]
        if after is not None:
            same = and_(column == value, order.after(jobs.c.id, last))
            having.append(or_(order.after(column, value), same))
        rows += _first(connection, having, order.sorted(column, jobs.c.id), limit, are_few=are_few)
    if lacking is not None and len(rows) < limit:
        nulls = [*conditions, lacking]
        if after is not None and value is None:
            nulls.append(order.after(jobs.c.id, last))
        left = limit - len(rows)
        rows += _first(connection, nulls, order.sorted(jobs.c.id), left, are_few=are_few)
    return rows


def _first(
    connection: Connection,
    conditions: Sequence[ColumnElement[bool]],
    order: Sequence[ColumnElement[Any]],
    limit: int,
    *,
    are_few: bool,
) -> list[Row[Any]]:
    """Return the first jobs of which conditions hold; few are found before they are sorted."""
    query = select(*JOB_COLUMNS).order_by(*order).limit(limit)
    if not are_few:
        return list(connection.execute(query.where(*conditions)))
    # Without this step the planner might follow the order's index after all.
    some = select(jobs.c.id).where(*conditions).offset(0).cte("some").prefix_with("MATERIALIZED")
    return list(connection.execute(query.join(some, some.c.id == jobs.c.id)))


def _are_few(
    connection: Connection, job_filter: JobFilter, conditions: Sequence[ColumnElement[bool]]
) -> bool:
    """Return whether jobs are so few that they can all be sorted.

    Along an order's index they might be the very last; the database expects them anywhere.
    """
    some = select(jobs.c.id).where(*conditions)
    if job_filter.sweep_ids is not None and job_filter.text is None:
        some = select(sweep_jobs.c.job_id).where(sweep_jobs.c.sweep_id.in_(job_filter.sweep_ids))
    counted = some.limit(MAX_SORTED + 1).subquery()
    number = connection.execute(select(func.count()).select_from(counted)).scalar_one()
    return int(number) <= MAX_SORTED
