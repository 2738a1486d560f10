"""Summaries of lists of jobs: counts by outcome, reason and flag."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Any, Final

from pydantic import with_config
from sqlalchemy import Connection, func, select

from buildarena_backend.database.tables import jobs
from buildarena_backend.jobs.filters import JobFilter, conditions_of
from buildarena_backend.states import JobState, Outcome

MAX_COUNTED: Final = 100_000
"""Jobs that are counted at most."""


@with_config(use_attribute_docstrings=True)
@dataclass(frozen=True, slots=True, kw_only=True)
class Ending:
    """Jobs with the same state and ending."""

    state: JobState
    outcome: Outcome | None
    """null while they have not ended."""
    reason: str | None
    """Class of the failure."""
    jobs: int


@with_config(use_attribute_docstrings=True)
@dataclass(frozen=True, slots=True, kw_only=True)
class JobSummary:
    """Summary of a list of jobs."""

    jobs: int
    all_counted: bool
    """false when there are more than were counted."""
    endings: list[Ending]
    """The most frequent first."""
    flags: dict[str, int]
    """Jobs with each flag, the most frequent first."""


def summarise(connection: Connection, job_filter: JobFilter) -> JobSummary:
    """Count the jobs of a list."""
    columns = jobs.c.state, jobs.c.outcome, jobs.c.reason, jobs.c.flags
    some = (
        select(*columns)
        .where(*conditions_of(connection, job_filter))
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
            Ending(
                state=JobState(state),
                outcome=None if outcome is None else Outcome(outcome),
                reason=reason,
                jobs=jobs_alike,
            )
            for (state, outcome, reason), jobs_alike in _foremost(endings)
        ],
        flags=dict(_foremost(flags)),
    )


def _foremost(counted: Counter[Any]) -> list[tuple[Any, int]]:
    """Return the counts, the greatest first; equal ones by key."""
    return sorted(counted.items(), key=lambda entry: (-entry[1], str(entry[0])))
