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
"""What can stand in an id."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JobFilter:
    """Filter of jobs; None means any.

    Attributes:
        sweep_ids: Only jobs of one of these sweeps.
        tasks: Only jobs on these tasks, beside what ``equals`` says of tasks.
        flags: Only jobs with one of these flags.
        id_prefix: Only jobs whose id begins like this.
        indicator_min: Only jobs with this indicator or a greater one.
        indicator_max: Only jobs with this indicator or a smaller one.
        text: Only jobs in whose id, task, model, reason or detail it stands, in any case.
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
        wanted = self.equals.get(column)
        return [wanted] if isinstance(wanted, str | int) else wanted


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
        """  # noqa: S608 - made of our own column names
    )


def conditions_of(connection: Connection, wanted: JobFilter) -> list[ColumnElement[bool]]:
    """Return a filter's SQL conditions.

    Args:
        connection: Where the values are that a text stands in.
    """
    found = conditions_but_text(wanted)
    if wanted.text is not None:
        found.append(or_(*ways_to_hold(connection, wanted.text)))
    return found


def conditions_but_text(wanted: JobFilter) -> list[ColumnElement[bool]]:
    """Return a filter's SQL conditions except the one on text."""
    found = [
        _is_one_of(jobs.c[name], values)
        for name in wanted.equals
        if (values := wanted.values(name)) is not None
    ]
    if wanted.sweep_ids is not None:
        of_one = _is_one_of(sweep_jobs.c.sweep_id, wanted.sweep_ids)
        found.append(jobs.c.id.in_(select(sweep_jobs.c.job_id).where(of_one)))
    if wanted.flags is not None:
        found.append(or_(*(jobs.c.flags.contains([flag]) for flag in wanted.flags)))
    if wanted.id_prefix is not None:
        found.append(begins_with(jobs.c.id, wanted.id_prefix))
    if wanted.indicator_min is not None:
        found.append(jobs.c.indicator >= wanted.indicator_min)
    if wanted.indicator_max is not None:
        found.append(jobs.c.indicator <= wanted.indicator_max)
    if wanted.tasks is not None:
        found.append(jobs.c.task == func.any(bound_texts(wanted.tasks)))
    if wanted.values("state") == [JobState.DONE] or wanted.values("outcome") is not None:
        # Said so that an order's index of ended jobs alone can serve.
        found.append(jobs.c.state == literal_column(f"'{JobState.DONE}'", Text))
    return found


def _is_one_of(column: ColumnElement[Any], values: Sequence[Any]) -> ColumnElement[bool]:
    return column == values[0] if len(values) == 1 else column.in_(values)


def ways_to_hold(connection: Connection, wanted: str) -> list[ColumnElement[bool]]:
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
