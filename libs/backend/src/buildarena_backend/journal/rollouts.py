"""Rollouts: simulations requested by a session, and their scores."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import Connection, bindparam, insert, select, update

from buildarena_backend import events
from buildarena_backend.database.database import Database
from buildarena_backend.database.rows import value_of
from buildarena_backend.database.tables import rollouts
from buildarena_benchmark import Score
from buildarena_benchmark.flags import is_disqualified


@dataclass(frozen=True, slots=True, kw_only=True)
class RolloutRequest:
    """A simulation to be done.

    Attributes:
        number: Place among the job's rollouts, from 0.
        final: True when the job ends with this rollout's score.
        engine: Simulator name.
        machine_hash: Artifact hash of the machine document.
        controls: The key presses of this rollout, or None for the task's own.
        seed: Seed of the varied world; None for the exact one.
    """

    number: int
    final: bool
    engine: str
    machine_hash: str
    controls: Sequence[Mapping[str, Any]] | None = None
    seed: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class RolloutRecord(RolloutRequest):
    """A rollout's row; the score is None until it was simulated.

    Attributes:
        seed: Seed of the varied world; None for the exact one.
        runner: The key whose runner ran it; None for a worker next to the database.
        audited: Whether its job is to be verified before it counts.
        annotations: Results of our engines for the machine, by engine; only of trials in the game.
        trace: The tracked body at 1 Hz, rows of time, x, y, z (seconds, units, world frame).
        wall_s: Duration of the simulation; the other names are those of the columns.
    """

    success: bool | None
    indicator: float | None
    metrics: Mapping[str, Any] | None
    flags: Sequence[str] | None
    trajectory_hash: str | None
    trace: Sequence[Sequence[float]] | None
    versions: Mapping[str, Any] | None
    annotations: Mapping[str, Any] | None = None
    wall_s: float | None
    runner: str | None = None
    audited: bool = False
    created_at: datetime
    finished_at: datetime | None

    @property
    def score(self) -> Score:
        """The score of this one trial; of one that was not simulated yet, that of nothing."""
        return Score(
            success=bool(self.success),
            indicator=self.indicator or 0.0,
            metrics=self.metrics or {},
            flags=tuple(self.flags or ()),
        )

    @property
    def counts(self) -> bool:
        """True if this trial is a success that no flag disqualifies."""
        return bool(self.success) and not is_disqualified(self.flags or ())

    @property
    def is_varied(self) -> bool:
        """True if it tries a finished machine again: not a test trial, and not a job's first."""
        return self.final and self.number > 0 and self.seed is not None


# Made once, because making them takes longer than running them.
_OF_JOB = (
    select(rollouts).where(rollouts.c.job_id == bindparam("job_id")).order_by(rollouts.c.number)
)
_REQUEST = insert(rollouts)
_COMPLETE = (
    update(rollouts)
    .where(rollouts.c.job_id == bindparam("of_job"), rollouts.c.number == bindparam("of_number"))
    .values(finished_at=events.now)
    .returning(rollouts)
)


class Rollouts:
    """Keeps rollouts. Writes take the transaction that also moves the job."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def request(self, job_id: str, request: RolloutRequest, *, connection: Connection) -> None:
        """Add a rollout that is to be simulated."""
        controls = None if request.controls is None else [dict(press) for press in request.controls]
        connection.execute(_REQUEST, {"job_id": job_id, **asdict(request), "controls": controls})

    def complete(
        self, job_id: str, number: int, *, connection: Connection, **values: Any
    ) -> RolloutRecord:
        """Write a rollout's score and trajectory; return the rollout as it is now."""
        parameters = {"of_job": job_id, "of_number": number, **values}
        return value_of(RolloutRecord, connection.execute(_COMPLETE, parameters).one())

    def read(self, job_id: str) -> list[RolloutRecord]:
        """Return all rollouts of a job in their order."""
        rows = self._database.all_rows(_OF_JOB, {"job_id": job_id})
        return [value_of(RolloutRecord, row) for row in rows]
