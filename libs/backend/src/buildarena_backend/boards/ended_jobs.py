"""Ended jobs in bulk."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pydantic import with_config
from sqlalchemy import Row, func, select

from buildarena_backend.boards.cells import BoardCells
from buildarena_backend.boards.trials import TRIAL_COLUMNS, TrialFilter, ended_job
from buildarena_backend.database.database import Database
from buildarena_backend.database.tables import jobs, rollouts, sweep_jobs
from buildarena_backend.states import JobState
from buildarena_benchmark.flags import is_disqualified
from buildarena_benchmark.leaderboard import SCORED, EndedJob


@with_config(use_attribute_docstrings=True)
@dataclass(frozen=True, slots=True, kw_only=True)
class Round:
    """A simulated machine of a job: all rollouts of one machine together."""

    machine_sha256: str
    """Hash of its document: the same machine in another simulator has the same."""
    success: bool
    indicator: float
    parts: int | None
    flags: tuple[str, ...]


class Boards:
    """Reads ended jobs.

    Attributes:
        cells: The same by cell, for boards.
    """

    def __init__(self, database: Database) -> None:
        self._database = database
        self.cells = BoardCells(database)

    def scored_ids(self, trial_filter: TrialFilter) -> list[str]:
        """Return the ids of scored jobs in order, including those that do not count."""
        query = (
            select(jobs.c.id)
            .where(*trial_filter.conditions(), jobs.c.outcome.in_(sorted(SCORED)))
            .order_by(jobs.c.id)
        )
        return [row.id for row in self._database.all_rows(query)]

    def by_track(self, trial_filter: TrialFilter) -> dict[str, int]:
        """Return the number of such jobs by track."""
        query = (
            select(jobs.c.track, func.count().label("ended"))
            .where(*trial_filter.conditions())
            .group_by(jobs.c.track)
            .order_by(jobs.c.track)
        )
        return {row.track: row.ended for row in self._database.all_rows(query)}

    def of_sweep(
        self, sweep_id: str, *, after: str = "", limit: int | None = None
    ) -> list[tuple[EndedJob, list[Round]]]:
        """Return a sweep's ended jobs with their rounds, in the order of their ids.

        Args:
            after: Only jobs with greater ids.
        """
        members = select(sweep_jobs.c.job_id).where(sweep_jobs.c.sweep_id == sweep_id)
        ended = jobs.c.state == JobState.DONE, jobs.c.id.in_(members), jobs.c.id > after
        query = select(*TRIAL_COLUMNS).where(*ended).order_by(jobs.c.id).limit(limit)
        job_ids = select(jobs.c.id).where(*ended).order_by(jobs.c.id).limit(limit)
        simulated = (
            select(rollouts)
            .where(
                rollouts.c.job_id.in_(job_ids),
                rollouts.c.finished_at.is_not(None),
                rollouts.c.seed.is_(None),
            )
            .order_by(rollouts.c.job_id, rollouts.c.number)
        )
        with self._database.transaction() as connection:
            trials = [ended_job(row) for row in connection.execute(query)]
            rounds: dict[str, list[Round]] = {}
            for row in connection.execute(simulated):
                _add_rollout(rounds.setdefault(row.job_id, []), row)
        return [(trial, rounds.get(trial.job_id, [])) for trial in trials]


def _add_rollout(rounds: list[Round], row: Row[Any]) -> None:
    """Add a rollout to the round of its machine; the best rollout of a round counts."""
    new = Round(
        machine_sha256=row.machine_hash,
        success=bool(row.success),
        indicator=row.indicator or 0.0,
        parts=(row.metrics or {}).get("parts"),
        flags=tuple(row.flags or ()),
    )
    if rounds and rounds[-1].machine_sha256 == new.machine_sha256:
        rounds[-1] = max(
            rounds[-1],
            new,
            key=lambda r: (r.success and not is_disqualified(r.flags), r.indicator),
        )
    else:
        rounds.append(new)
