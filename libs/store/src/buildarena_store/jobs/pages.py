"""Pages of jobs: which, in which order, and where the page before ended."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
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
    TextClause,
    and_,
    extract,
    func,
    literal_column,
    or_,
    select,
    text,
)

from buildarena_store.ids import begins_with
from buildarena_store.jobs.job import JOB_COLUMNS, Job
from buildarena_store.rows import bound_texts
from buildarena_store.states import JobState
from buildarena_store.tables import COST_OR_NULL, jobs, sweep_jobs

Sort = Literal["created", "finished", "indicator", "cost", "task", "model", "seed", "outcome"]
SortValue = datetime | float | Decimal | str | int | None

_COLUMNS: Final[Mapping[Sort, ColumnElement[Any]]] = MappingProxyType(
    {
        "created": jobs.c.created_at,
        "finished": jobs.c.finished_at,
        "indicator": jobs.c.indicator,
        # What nobody counted is no cost of 0. As the index has it, word for word.
        "cost": literal_column(COST_OR_NULL.text, Numeric(14, 6)),
        "task": jobs.c.task,
        "model": jobs.c.model,
        "seed": jobs.c.seed,
        "outcome": jobs.c.outcome,
    }
)
_DURATION_S: Final = extract("epoch", jobs.c.finished_at - jobs.c.started_at)
ENDED_ONLY: Final[frozenset[Sort]] = frozenset({"finished", "indicator", "outcome"})
"""What only jobs that have ended have."""
MAX_SORTED: Final = 40_000
"""Jobs that are sorted for a page; of more, the first are found along the order's index."""
BEGINNING: Final = 10_000
"""Jobs of an order that are looked through first for those with a flag: to count all that have it,
each must be read."""
_ID_PART: Final = re.compile(r"[job_0-9a-f]+", re.IGNORECASE)
"""What can stand in an id."""
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


@dataclass(frozen=True, slots=True, kw_only=True)
class JobFilter:
    """Which jobs are meant; None means any.

    Attributes:
        sweep_id: Only this sweep's jobs.
        tasks: Only jobs on these tasks.
        flag: Only jobs with this flag.
        id_prefix: Only jobs whose id begins like this.
        indicator_min: Only jobs with this indicator or a greater one.
        indicator_max: Only jobs with this indicator or a smaller one.
        cost_min_usd: Only jobs that cost as much or more, in US dollars, as far as that is known.
        cost_max_usd: Only jobs that cost as much or less.
        duration_min_s: Only jobs that took as long or longer, from start to end.
        duration_max_s: Only jobs that took as long or shorter.
        text: Only jobs in whose id, task, model, reason or detail it stands, in any case.
        since: Only jobs that ended then or later.
        until: Only jobs that ended before.
        equals: Column values to match.
    """

    sweep_id: str | None = None
    tasks: Sequence[str] | None = None
    flag: str | None = None
    id_prefix: str | None = None
    indicator_min: float | None = None
    indicator_max: float | None = None
    cost_min_usd: Decimal | None = None
    cost_max_usd: Decimal | None = None
    duration_min_s: float | None = None
    duration_max_s: float | None = None
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
    conditions = _conditions(wanted)
    place = _Place(order, after)
    if wanted.text is None:
        return _read(connection, wanted, conditions, place, limit)
    # One way after another: all at once they have no index in common.
    ids = {
        row.id
        for way in _ways_to_hold(connection, wanted.text)
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


def distinct_values(column: ColumnElement[Any]) -> TextClause:
    """The query for a column's values in their order: one probe of its index for each."""
    name = column.name
    return text(
        f"""
        WITH RECURSIVE found (value) AS (
            (SELECT {name} FROM jobs WHERE {name} IS NOT NULL ORDER BY {name} LIMIT 1)
            UNION ALL
            SELECT (SELECT {name} FROM jobs WHERE {name} > found.value ORDER BY {name} LIMIT 1)
            FROM found WHERE found.value IS NOT NULL
        )
        SELECT value FROM found WHERE value IS NOT NULL
        """  # noqa: S608 - made of our own column names
    )


def conditions_of(connection: Connection, wanted: JobFilter) -> list[ColumnElement[bool]]:
    """What a filter comes to.

    Args:
        connection: Where the values are that a text stands in.
        wanted: Which jobs.
    """
    found = _conditions(wanted)
    if wanted.text is not None:
        found.append(or_(*_ways_to_hold(connection, wanted.text)))
    return found


def _conditions(wanted: JobFilter) -> list[ColumnElement[bool]]:
    """What a filter comes to, but for its text."""
    found = [jobs.c[name] == value for name, value in wanted.equals.items() if value is not None]
    if wanted.sweep_id is not None:
        members = select(sweep_jobs.c.job_id).where(sweep_jobs.c.sweep_id == wanted.sweep_id)
        found.append(jobs.c.id.in_(members))
    if wanted.flag is not None:
        found.append(jobs.c.flags.contains([wanted.flag]))
    if wanted.id_prefix is not None:
        found.append(begins_with(jobs.c.id, wanted.id_prefix))
    found += _within(jobs.c.indicator, wanted.indicator_min, wanted.indicator_max)
    found += _within(_COLUMNS["cost"], wanted.cost_min_usd, wanted.cost_max_usd)
    found += _within(_DURATION_S, wanted.duration_min_s, wanted.duration_max_s)
    if wanted.tasks is not None:
        found.append(jobs.c.task == func.any(bound_texts(wanted.tasks)))
    if wanted.since is not None:
        found.append(jobs.c.finished_at >= wanted.since)
    if wanted.until is not None:
        # No job ends before it was made: a list by that time can begin there.
        found += [jobs.c.finished_at < wanted.until, jobs.c.created_at < wanted.until]
    if _means_ended(wanted):
        # Said so that an order's index of ended jobs alone can serve.
        found.append(jobs.c.state == literal_column(f"'{JobState.DONE}'", Text))
    return found


def _within(
    column: ColumnElement[Any], least: float | Decimal | None, most: float | Decimal | None
) -> list[ColumnElement[bool]]:
    found = [] if least is None else [column >= least]
    return found if most is None else [*found, column <= most]


def _means_ended(wanted: JobFilter) -> bool:
    """Whether only jobs that have ended can be meant."""
    durations = wanted.duration_min_s, wanted.duration_max_s
    ended = wanted.since, wanted.until, wanted.equals.get("outcome"), *durations
    return any(value is not None for value in ended) or (
        wanted.equals.get("state") == JobState.DONE
    )


def _ways_to_hold(connection: Connection, wanted: str) -> list[ColumnElement[bool]]:
    """In which ways a text can stand in id, task, model, reason or detail, in any case.

    Tasks, models and reasons are few: those with the text are found first.
    """
    ways = [jobs.c.detail.icontains(wanted, autoescape=True)]
    for column in (jobs.c.task, jobs.c.model, jobs.c.reason):
        values = connection.execute(distinct_values(column)).scalars()
        held = [value for value in values if wanted.lower() in value.lower()]
        if held:
            ways.append(column == func.any(bound_texts(held)))
    if _ID_PART.fullmatch(wanted):
        held_in = jobs.c.id.contains(wanted.lower(), autoescape=True)
        ids = select(jobs.c.id).where(held_in).limit(MAX_SORTED + 1)
        some = connection.execute(ids).scalars().all()
        few = len(some) <= MAX_SORTED
        ways.append(jobs.c.id == func.any(bound_texts(some)) if few else held_in)
    return ways


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
