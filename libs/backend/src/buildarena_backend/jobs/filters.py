"""Filters of jobs, and their SQL conditions."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from sqlalchemy import (
    ColumnElement,
    Connection,
    Text,
    TextClause,
    func,
    literal_column,
    or_,
    select,
    text,
)

from buildarena_backend.database.rows import bound_texts
from buildarena_backend.database.tables import jobs, sweep_jobs
from buildarena_backend.ids import begins_with
from buildarena_backend.states import JobState

MAX_SORTED: Final = 40_000
"""Jobs that are sorted for a page; of more, the first are found along the order's index."""
_ID_PART: Final = re.compile(r"[job_0-9a-f]+", re.IGNORECASE)
"""Characters of an id."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JobFilter:
    """Filter of jobs; None means any.

    Attributes:
        tasks: Only jobs on these tasks, in addition to the task of ``equals``.
        indicator_min: Only jobs with this indicator or a greater one.
        indicator_max: Only jobs with this indicator or a smaller one.
        text: Only jobs with it in their id, task, model, reason or detail, in any case.
        equals: Values to match by column: one of them, of a list.
    """

    sweep_ids: Sequence[str] | None = None
    tasks: Sequence[str] | None = None
    flags: Sequence[str] | None = None
    id_prefix: str | None = None
    indicator_min: float | None = None
    indicator_max: float | None = None
    text: str | None = None
    equals: Mapping[str, str | int | Sequence[str] | None] = field(default_factory=dict)

    def values(self, column: str) -> Sequence[Any] | None:
        """Return the values that a column may have; None for any."""
        value = self.equals.get(column)
        return [value] if isinstance(value, str | int) else value


def distinct_values(column: ColumnElement[Any]) -> TextClause:
    """Return the query for a column's values in their order: one probe of its index for each."""
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
        """  # noqa: S608 - column names only
    )


def conditions_of(connection: Connection, job_filter: JobFilter) -> list[ColumnElement[bool]]:
    """Return a filter's SQL conditions."""
    conditions = conditions_but_text(job_filter)
    if job_filter.text is not None:
        conditions.append(or_(*ways_to_hold(connection, job_filter.text)))
    return conditions


def conditions_but_text(job_filter: JobFilter) -> list[ColumnElement[bool]]:
    """Return a filter's SQL conditions except the one on text."""
    conditions = [
        _is_one_of(jobs.c[name], values)
        for name in job_filter.equals
        if (values := job_filter.values(name)) is not None
    ]
    if job_filter.sweep_ids is not None:
        of_one = _is_one_of(sweep_jobs.c.sweep_id, job_filter.sweep_ids)
        conditions.append(jobs.c.id.in_(select(sweep_jobs.c.job_id).where(of_one)))
    if job_filter.flags is not None:
        conditions.append(or_(*(jobs.c.flags.contains([flag]) for flag in job_filter.flags)))
    if job_filter.id_prefix is not None:
        conditions.append(begins_with(jobs.c.id, job_filter.id_prefix))
    if job_filter.indicator_min is not None:
        conditions.append(jobs.c.indicator >= job_filter.indicator_min)
    if job_filter.indicator_max is not None:
        conditions.append(jobs.c.indicator <= job_filter.indicator_max)
    if job_filter.tasks is not None:
        conditions.append(jobs.c.task == func.any(bound_texts(job_filter.tasks)))
    if job_filter.values("state") == [JobState.DONE] or job_filter.values("outcome") is not None:
        # In this form an order's index of ended jobs alone can serve.
        conditions.append(jobs.c.state == literal_column(f"'{JobState.DONE}'", Text))
    return conditions


def _is_one_of(column: ColumnElement[Any], values: Sequence[Any]) -> ColumnElement[bool]:
    return column == values[0] if len(values) == 1 else column.in_(values)


def ways_to_hold(connection: Connection, needle: str) -> list[ColumnElement[bool]]:
    """Return conditions for a text in id, task, model, reason or detail, in any case.

    Tasks, models and reasons are few: those with the text are found first.
    """
    ways = [jobs.c.detail.icontains(needle, autoescape=True)]
    for column in (jobs.c.task, jobs.c.model, jobs.c.reason):
        values = connection.execute(distinct_values(column)).scalars()
        held = [value for value in values if needle.lower() in value.lower()]
        if held:
            ways.append(column == func.any(bound_texts(held)))
    if _ID_PART.fullmatch(needle):
        held_in = jobs.c.id.contains(needle.lower(), autoescape=True)
        ids = select(jobs.c.id).where(held_in).limit(MAX_SORTED + 1)
        some = connection.execute(ids).scalars().all()
        few = len(some) <= MAX_SORTED
        ways.append(jobs.c.id == func.any(bound_texts(some)) if few else held_in)
    return ways
