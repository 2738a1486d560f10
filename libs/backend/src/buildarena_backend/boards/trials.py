"""Ended jobs one by one: filters and readers."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

from sqlalchemy import ColumnElement, Integer, Row, cast, exists, func

from buildarena_backend.database.rows import bound_texts
from buildarena_backend.database.tables import jobs, sweep_jobs
from buildarena_backend.states import EXTERNAL_PROVIDER, FILE_PROVIDER, Audit, JobState
from buildarena_benchmark.leaderboard import EndedJob


class CellId(NamedTuple):
    """Key of a cell: one model configuration on one version of a task in one track."""

    track: str
    task: str
    task_version: str
    configuration: str


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialFilter:
    """Filter of ended jobs; None means any.

    Attributes:
        sweeps: Ids of sweeps: jobs of any of these.
    """

    track: str | None = None
    tasks: Collection[str] | None = None
    models: Collection[str] | None = None
    cells: Collection[CellId] | None = None
    sweeps: Collection[str] | None = None

    def conditions(self) -> list[ColumnElement[bool]]:
        """Return the conditions for a query of jobs; trials of files are not ranked."""
        conditions = [jobs.c.state == JobState.DONE, RANKED]
        if self.track is not None:
            conditions.append(jobs.c.track == self.track)
        for column, values in ((jobs.c.task, self.tasks), (jobs.c.model, self.models)):
            if values is not None:
                conditions.append(column == func.any(bound_texts(sorted(values))))
        if self.cells is not None:
            conditions.append(in_cells(self.cells))
        if self.sweeps is not None:
            conditions.append(
                exists().where(
                    sweep_jobs.c.job_id == jobs.c.id,
                    sweep_jobs.c.sweep_id == func.any(bound_texts(sorted(self.sweeps))),
                )
            )
        return conditions


def in_cells(cells: Collection[CellId]) -> ColumnElement[bool]:
    """Return the condition that a job is in one of some cells."""
    columns = [bound_texts(list(values)) for values in zip(*sorted(cells), strict=True)]
    unnested = func.unnest(*columns or [bound_texts([])] * len(CellId._fields))
    cell_rows = unnested.table_valued(*CellId._fields).render_derived(name="wanted")
    return exists().where(
        jobs.c.task == cell_rows.c.task,
        jobs.c.task_version == cell_rows.c.task_version,
        jobs.c.model_hash == cell_rows.c.configuration,
        jobs.c.track == cell_rows.c.track,
    )


COUNTS: Final = func.coalesce(jobs.c.audit, Audit.VERIFIED.value) == Audit.VERIFIED
"""Condition that a scored job counts, as far as its audit goes."""
RANKED: Final = func.coalesce(jobs.c.model_config["provider"].as_string(), "") != FILE_PROVIDER


_OWN: Final = (
    *("track", "task", "task_version", "model", "seed", "outcome", "reason", "success"),
    *("indicator", "flags", "refusals", "requests", "input_tokens", "output_tokens", "cost_usd"),
    *("actions", "refused_actions", "finished_at", "ran_on_runner", "limits"),
)
TRIAL_COLUMNS: Final = [
    *(jobs.c[name] for name in _OWN),
    (~COUNTS).label("unverified"),
    jobs.c.id.label("job_id"),
    jobs.c.model_hash.label("configuration"),
    jobs.c.model_config["decoding"].label("decoding"),
    (jobs.c.model_config["provider"].as_string() == EXTERNAL_PROVIDER).label("external"),
    *(cast(jobs.c.metrics[name], Integer).label(name) for name in ("parts", "test_trials")),
]
"""Columns of `ended_job`."""


def ended_job(row: Row[Any]) -> EndedJob:
    """Return the ended job of a row of `TRIAL_COLUMNS`."""
    values = {name: getattr(row, name) for name in EndedJob.__dataclass_fields__}
    values |= {
        "decoding": decoding_of(row.decoding, row.limits),
        "success": row.success or 0.0,
        "indicator": row.indicator or 0.0,
        "flags": tuple(row.flags or ()),
        "refusals": row.refusals or {},
        "cost_usd": float(row.cost_usd),
    }
    if row.external:
        values |= dict.fromkeys(("requests", "input_tokens", "output_tokens", "cost_usd"))
    return EndedJob(**values)


def decoding_of(decoding: Mapping[str, Any] | None, limits: Mapping[str, Any]) -> dict[str, Any]:
    """Return a configuration's sampling parameters, with the limits of its sessions, if any."""
    return {**(decoding or {}), **({"limits": limits} if limits else {})}
