"""Pages of jobs: in which order, and where the page before ended."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from decimal import Decimal
from types import MappingProxyType
from typing import Any, Final, Literal

from sqlalchemy import (
    ColumnElement,
    Connection,
    Numeric,
    Row,
    Text,
    and_,
    func,
    literal_column,
    or_,
    select,
)

from buildarena_backend.database.rows import bound_texts
from buildarena_backend.database.tables import COST_OR_NULL, jobs, sweep_jobs
from buildarena_backend.jobs.filters import MAX_SORTED, JobFilter, conditions_but_text, ways_to_hold
from buildarena_backend.jobs.job import JOB_COLUMNS, Job
from buildarena_backend.states import JobState

Sort = Literal["created", "finished", "indicator", "cost", "task", "model", "seed", "outcome"]
SortValue = datetime | float | Decimal | str | int | None

# What nobody counted is no cost of 0. As the index has it, word for word.
_COLUMNS: Final[Mapping[Sort, ColumnElement[Any]]] = MappingProxyType(
    {
        "created": jobs.c.created_at,
        "finished": jobs.c.finished_at,
        "indicator": jobs.c.indicator,
        "cost": literal_column(COST_OR_NULL.text, Numeric(14, 6)),
        "task": jobs.c.task,
        "model": jobs.c.model,
        "seed": jobs.c.seed,
        "outcome": jobs.c.outcome,
    }
)
ENDED_ONLY: Final[frozenset[Sort]] = frozenset({"finished", "indicator", "outcome"})
"""What only jobs that have ended have."""
BEGINNING: Final = 10_000
"""Jobs of an order that are looked through first for those with a flag: to count all that have it,
each must be read."""
NULLABLE: Final[frozenset[Sort]] = frozenset({"finished", "indicator", "cost", "outcome"})
"""What a job may lack; those that do come last, in both directions."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """An order of jobs; equal ones are in the order of their ids, in the same direction.

    Attributes:
        by: What they are sorted by.
        descending: Whether the greatest, or newest, comes first.
    """

    by: Sort = "created"
    descending: bool = True


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
        "outcome": job.outcome,
    }
    return values[by]


def read_page(
    connection: Connection,
    wanted: JobFilter,
    order: Order,
    after: tuple[SortValue, str] | None,
    limit: int,
) -> list[Row[Any]]:
    """The rows of a page.

    Those that have no such figure come last, by a query of their own: so both can go along the
    one index of the order, in either direction.

    Args:
        connection: Where to read.
        wanted: Which jobs.
        order: In which order.
        after: What the last job of the page before is sorted by, and its id.
        limit: Rows at most.
    """
    conditions = conditions_but_text(wanted)
    place = _Place(order, after)
    if wanted.text is None:
        return _read(connection, wanted, conditions, place, limit)
    # One way after another: all at once they have no index in common.
    ids = {
        row.id
        for way in ways_to_hold(connection, wanted.text)
        for row in _read(connection, wanted, [*conditions, way], place, limit)
    }
    return _read_few(
        connection, [jobs.c.id == func.any(bound_texts(sorted(ids)))], order, None, limit
    )


@dataclass(frozen=True, slots=True)
class _Place:
    """Where a page begins: behind a job, by what it is sorted by and its id, or at the front."""

    order: Order
    after: tuple[SortValue, str] | None

    @property
    def has_figure(self) -> bool:
        """Whether jobs that have the figure are still to come."""
        return self.after is None or self.after[0] is not None

    def behind(self) -> list[ColumnElement[bool]]:
        """What is behind it and has the figure."""
        found: list[ColumnElement[bool]] = []
        if self.after is not None and self.after[0] is not None:
            found.append(_behind(self.order, *self.after))
        if self.order.by in NULLABLE:
            found.append(_COLUMNS[self.order.by].is_not(None))
        return found

    def rest(self) -> list[ColumnElement[bool]]:
        """What is behind it and lacks the figure."""
        found: list[ColumnElement[bool]] = [_COLUMNS[self.order.by].is_(None)]
        if self.after is not None and self.after[0] is None:
            found.append(_further(self.order, jobs.c.id, self.after[1]))
        return found


def _read(
    connection: Connection,
    wanted: JobFilter,
    conditions: Sequence[ColumnElement[bool]],
    place: _Place,
    limit: int,
) -> list[Row[Any]]:
    """As `read_page`, with the conditions that the filter comes to."""
    order = place.order
    ended = wanted.equals.get("state") in {JobState.DONE, None}
    if order.by in ENDED_ONLY and not ended:
        # None of them has such a figure.
        return _read_by_id(connection, conditions, place, limit)
    if wanted.flag is not None and place.has_figure and order.by != "cost":
        found = _read_beginning(connection, conditions, place, limit)
        if len(found) == limit:
            return found
    if conditions and _are_few(connection, wanted, conditions):
        return _read_few(connection, conditions, order, place.after, limit)
    found = []
    if place.has_figure:
        found = _read_along(connection, wanted, [*conditions, *place.behind()], order, limit)
    if order.by in NULLABLE and len(found) < limit:
        rest = [*conditions, *place.rest()]
        found += _read_along(connection, wanted, rest, order, limit - len(found))
    return found


def _read_by_id(
    connection: Connection,
    conditions: Sequence[ColumnElement[bool]],
    place: _Place,
    limit: int,
) -> list[Any]:
    query = select(*JOB_COLUMNS).where(*conditions)
    if place.after is not None:
        query = query.where(_further(place.order, jobs.c.id, place.after[1]))
    return list(connection.execute(query.order_by(*_sorted(place.order, jobs.c.id)).limit(limit)))


def _read_beginning(
    connection: Connection,
    conditions: Sequence[ColumnElement[bool]],
    place: _Place,
    limit: int,
) -> list[Any]:
    """The first jobs of a page, as far as they are at the beginning of the order."""
    order = place.order
    columns = _sorted(order, _COLUMNS[order.by], jobs.c.id)
    first = select(jobs.c.id).where(*place.behind()).order_by(*columns).limit(BEGINNING).subquery()
    query = select(*JOB_COLUMNS).join(first, first.c.id == jobs.c.id).where(*conditions)
    return list(connection.execute(query.order_by(*columns).limit(limit)))


def _read_along(
    connection: Connection,
    wanted: JobFilter,
    conditions: Sequence[ColumnElement[bool]],
    order: Order,
    limit: int,
) -> list[Any]:
    """The first jobs along an order's index."""
    place = _COLUMNS[order.by]
    query = select(*JOB_COLUMNS, place.label("place")).where(*conditions).limit(limit)
    query = query.order_by(*_sorted(order, place, jobs.c.id))
    if order.by != "cost":
        return list(connection.execute(query))
    # What waits has cost nothing yet: in one index, ended jobs would all lie behind it.
    ended = jobs.c.state == literal_column(f"'{JobState.DONE}'", Text)
    state = wanted.equals.get("state")
    parts = [ended, ~ended] if state is None else [ended if state == JobState.DONE else ~ended]
    rows = [row for part in parts for row in connection.execute(query.where(part))]
    return sorted(rows, key=lambda row: (row.place or 0, row.id), reverse=order.descending)[:limit]


def _are_few(
    connection: Connection, wanted: JobFilter, conditions: Sequence[ColumnElement[bool]]
) -> bool:
    """Whether jobs are so few that they can all be sorted.

    Along an order's index they might be the very last; the database expects them anywhere.
    """
    some = select(jobs.c.id).where(*conditions)
    if wanted.sweep_id is not None and wanted.text is None:
        some = select(sweep_jobs.c.job_id).where(sweep_jobs.c.sweep_id == wanted.sweep_id)
    counted = some.limit(MAX_SORTED + 1).subquery()
    number = connection.execute(select(func.count()).select_from(counted)).scalar_one()
    return int(number) <= MAX_SORTED


def _read_few(
    connection: Connection,
    conditions: Sequence[ColumnElement[bool]],
    order: Order,
    after: tuple[SortValue, str] | None,
    limit: int,
) -> list[Row[Any]]:
    column = _COLUMNS[order.by]
    chosen = select(jobs.c.id, column.label("place")).where(*conditions)
    if after is not None:
        value, id_ = after
        behind = [and_(column.is_(None), _further(order, jobs.c.id, id_))]
        if value is not None:
            behind = [_behind(order, value, id_), column.is_(None)]
        chosen = chosen.where(or_(*behind))
    # Were it not made first, the order's index might be gone along after all.
    some = chosen.offset(0).subquery("some")
    place, id_order = _sorted(order, some.c.place, some.c.id)
    first = select(some.c.id, some.c.place).order_by(place.nulls_last(), id_order).limit(limit)
    page = first.subquery("page")
    place, id_order = _sorted(order, page.c.place, page.c.id)
    query = select(*JOB_COLUMNS).join(page, page.c.id == jobs.c.id)
    return list(connection.execute(query.order_by(place.nulls_last(), id_order)))


def _sorted(order: Order, *columns: ColumnElement[Any]) -> list[ColumnElement[Any]]:
    return [column.desc() if order.descending else column.asc() for column in columns]


def _behind(order: Order, value: SortValue, id_: str) -> ColumnElement[bool]:
    column = _COLUMNS[order.by]
    return or_(
        _further(order, column, value), and_(column == value, _further(order, jobs.c.id, id_))
    )


def _further(order: Order, column: ColumnElement[Any], value: Any) -> ColumnElement[bool]:
    further: ColumnElement[bool] = column < value if order.descending else column > value
    return further
