"""Ended jobs one by one: filters and readers."""

from __future__ import annotations

import sys
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

from sqlalchemy import ColumnElement, Connection, Integer, cast, exists, func

from buildarena_backend.database.rows import bound_texts
from buildarena_backend.database.tables import jobs, sweep_jobs
from buildarena_backend.states import EXTERNAL_PROVIDER, FILE_PROVIDER, Audit, JobState
from buildarena_benchmark.leaderboard import EndedJob

CHUNK: Final = 5000
"""Rows that are in memory twice at a time while all are read."""


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

    def within(self, cells: Collection[CellId]) -> TrialFilter:
        """Return the same filter, limited to some cells."""
        return replace(self, cells=cells)

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


TRIAL_COLUMNS: Final = [
    jobs.c.track,
    jobs.c.task,
    jobs.c.task_version,
    jobs.c.model,
    jobs.c.seed,
    jobs.c.outcome,
    jobs.c.reason,
    jobs.c.success,
    jobs.c.indicator,
    jobs.c.flags,
    jobs.c.refusals,
    jobs.c.requests,
    jobs.c.input_tokens,
    jobs.c.output_tokens,
    jobs.c.cost_usd,
    jobs.c.actions,
    jobs.c.refused_actions,
    jobs.c.finished_at,
    jobs.c.ran_on_runner,
    (~COUNTS).label("unverified"),
    jobs.c.id.label("job_id"),
    jobs.c.model_hash.label("configuration"),
    jobs.c.model_config["decoding"].label("decoding"),
    (jobs.c.model_config["provider"].as_string() == EXTERNAL_PROVIDER).label("external"),
    jobs.c.limits,
    cast(jobs.c.metrics["parts"], Integer).label("parts"),
]


def read_trials(connection: Connection, query: Any) -> Iterator[EndedJob]:
    """Yield the trials that a query of `TRIAL_COLUMNS` finds."""
    # A hundred thousand rows repeat a few dozen words and settings: one object serves them all.
    decodings: dict[str, Mapping[str, Any]] = {}
    result = connection.execution_options(stream_results=True).execute(query)
    for row in result.yield_per(CHUNK):
        # What an external agent used is unknown, which is not nothing.
        is_counted = not row.external
        yield EndedJob(
            job_id=row.job_id,
            track=sys.intern(row.track),
            task=sys.intern(row.task),
            task_version=sys.intern(row.task_version),
            model=sys.intern(row.model),
            configuration=sys.intern(row.configuration),
            decoding=decodings.setdefault(row.configuration, decoding_of(row.decoding, row.limits)),
            seed=row.seed,
            outcome=sys.intern(row.outcome),
            reason=None if row.reason is None else sys.intern(row.reason),
            success=row.success or 0.0,
            indicator=row.indicator or 0.0,
            parts=row.parts,
            flags=tuple(row.flags or ()),
            refusals=row.refusals or {},
            requests=row.requests if is_counted else None,
            input_tokens=row.input_tokens if is_counted else None,
            output_tokens=row.output_tokens if is_counted else None,
            cost_usd=float(row.cost_usd) if is_counted else None,
            actions=row.actions,
            refused_actions=row.refused_actions,
            finished_at=row.finished_at,
            ran_on_runner=row.ran_on_runner,
            unverified=row.unverified,
        )


def decoding_of(decoding: Mapping[str, Any] | None, limits: Mapping[str, Any]) -> dict[str, Any]:
    """Return a configuration's sampling parameters, with the limits of its sessions, if any."""
    return {**(decoding or {}), **({"limits": limits} if limits else {})}
