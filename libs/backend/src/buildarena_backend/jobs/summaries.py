"""Summaries of lists of jobs: counts by outcome, reason and flag."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from sqlalchemy import Connection, func, select

from buildarena_backend.database.tables import jobs
from buildarena_backend.jobs.filters import JobFilter, conditions_of

MAX_COUNTED: Final = 100_000
"""Jobs that are counted at most."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ending:
    """Jobs that stand or ended alike.

    Attributes:
        state: Their state.
        outcome: How they ended; None while they have not.
        reason: The class of their failure, if they have one.
        jobs: How many.
    """

    state: str
    outcome: str | None
    reason: str | None
    jobs: int


@dataclass(frozen=True, slots=True, kw_only=True)
class JobSummary:
    """Summary of a list of jobs.

    Attributes:
        jobs: Jobs that were counted.
        all_counted: Whether these are all; of very many, some are counted.
        endings: How they ended, the most frequent first.
        flags: How many jobs have each flag, the most frequent first.
    """

    jobs: int
    all_counted: bool
    endings: Sequence[Ending]
    flags: Mapping[str, int]


def summarise(connection: Connection, wanted: JobFilter) -> JobSummary:
    """Count the jobs of a list."""
    columns = jobs.c.state, jobs.c.outcome, jobs.c.reason, jobs.c.flags
    some = (
        select(*columns)
        .where(*conditions_of(connection, wanted))
        .limit(MAX_COUNTED + 1)
        .subquery("some_jobs")
    )
    alike = some.c.state, some.c.outcome, some.c.reason, some.c.flags
    number = func.count().label("jobs")
    rows = connection.execute(select(*alike, number).group_by(*alike)).all()
    endings: Counter[Any] = Counter()
    flags: Counter[str] = Counter()
    for row in rows:
        endings[row.state, row.outcome, row.reason] += row.jobs
        flags.update(dict.fromkeys(row.flags or (), row.jobs))
    total = endings.total()
    return JobSummary(
        jobs=min(total, MAX_COUNTED),
        all_counted=total <= MAX_COUNTED,
        endings=[
            Ending(state=state, outcome=outcome, reason=reason, jobs=jobs_alike)
            for (state, outcome, reason), jobs_alike in _foremost(endings)
        ],
        flags=dict(_foremost(flags)),
    )


def _foremost(counted: Counter[Any]) -> list[tuple[Any, int]]:
    """Count, the greatest first; equal ones by what they count."""
    return sorted(counted.items(), key=lambda entry: (-entry[1], str(entry[0])))
