"""Cells with their tallies, made from jobs by the database."""

from __future__ import annotations

from buildarena_geometry import kernels  # noqa: F401 - before numpy

# isort: split

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from sqlalchemy import (
    BigInteger,
    Connection,
    Double,
    LargeBinary,
    Row,
    Text,
    case,
    cast,
    func,
    literal,
    literal_column,
    select,
)

from buildarena_backend.boards.trials import COUNTS, CellId, TrialFilter, decoding_of
from buildarena_backend.database.database import AS_THEY_ARE
from buildarena_backend.database.rows import bound_texts
from buildarena_backend.database.tables import jobs
from buildarena_backend.states import EXTERNAL_PROVIDER
from buildarena_benchmark.leaderboard import (
    UNKNOWN_TOKENS,
    Cell,
    CellName,
    Tally,
    Total,
    summarise_tallies,
)


@dataclass(frozen=True, kw_only=True)
class CellRecord:
    """A cell of boards.

    Attributes:
        decoding: Sampling of the model's replies and the limits of its sessions, if any.
        jobs: Number of its ended jobs; 0 when all have left.
    """

    id: CellId
    model: str
    decoding: Mapping[str, Any]
    jobs: int
    newest: datetime | None
    tallies: Sequence[Tally]

    @cached_property
    def summary(self) -> Cell:
        """Summary of the cell for boards."""
        name = CellName(
            task=self.id.task,
            model=self.model,
            configuration=self.id.configuration,
            decoding=self.decoding,
        )
        return summarise_tallies(name, self.tallies)


def cell_record(
    id_: CellId, model: str, decoding: Mapping[str, Any], tallies: Sequence[Tally]
) -> CellRecord:
    """Return the cell of some tallies."""
    return CellRecord(
        id=id_,
        model=model,
        decoding=decoding,
        jobs=sum(tally.number for tally in tallies),
        newest=max((tally.newest for tally in tallies if tally.newest), default=None),
        tallies=tallies,
    )


def tally_jobs(connection: Connection, trial_filter: TrialFilter) -> list[CellRecord]:
    """Return the cells of the filtered jobs, by two queries in one transaction."""
    groups: dict[CellId, list[Row[Any]]] = {}
    figures: list[Any] = [*_GROUPS, *_EACH]
    query = select(*figures).where(*trial_filter.conditions()).group_by(*_GROUPS)
    for row in connection.execute(query, execution_options=AS_THEY_ARE):
        groups.setdefault(_id_of(row), []).append(row)
    samples = [rows[0].sample for rows in groups.values()]
    columns: list[Any] = [jobs.c.id, jobs.c.model, jobs.c.model_config["decoding"], jobs.c.limits]
    sampled = select(*columns).where(jobs.c.id == func.any(bound_texts(samples)))
    configs = {row.id: row for row in connection.execute(sampled)}
    records = []
    for id_, rows in groups.items():
        config = configs[rows[0].sample]
        decoding = decoding_of(config[2], config.limits)
        records.append(cell_record(id_, config.model, decoding, [_tally_of(row) for row in rows]))
    return records


_EXTERNAL: Final = func.coalesce(
    jobs.c.model_config["provider"].as_string() == EXTERNAL_PROVIDER, False
)
_PARTS: Final = cast(jobs.c.metrics["parts"], BigInteger)
_TESTS: Final = cast(jobs.c.metrics["test_trials"], BigInteger)
_CELL: Final = [
    jobs.c.track,
    jobs.c.task,
    jobs.c.task_version,
    jobs.c.model_hash.label("configuration"),
]
_GROUPS: Final = [
    *_CELL,
    jobs.c.outcome,
    jobs.c.reason,
    func.coalesce(
        func.nullif(jobs.c.flags, literal_column("'null'::jsonb")), literal_column("'[]'::jsonb")
    ).label("flags"),
    jobs.c.ran_on_runner,
    (~COUNTS).label("unverified"),
    _EXTERNAL.label("external"),
]


def _bytes_of(sent: Any) -> Any:
    return func.string_agg(sent, cast(literal(b"", LargeBinary), LargeBinary), type_=LargeBinary)


_GAINED: Final = func.coalesce(case((jobs.c.success > 0, jobs.c.indicator), else_=0.0), 0.0)
"""The same as `EndedJob.gained`."""
_OBJECT: Final = func.jsonb_typeof(jobs.c.refusals) == "object"
_EACH: Final = [
    func.min(jobs.c.id).label("sample"),
    func.count().label("number"),
    _bytes_of(func.float8send(func.coalesce(jobs.c.success, 0.0))).label("shares"),
    _bytes_of(func.float8send(_GAINED)).label("indicators"),
    _bytes_of(func.float8send(cast(jobs.c.cost_usd, Double))).label("costs"),
    _bytes_of(func.int8send(jobs.c.output_tokens)).label("output_tokens"),
    func.max(func.coalesce(jobs.c.finished_at, jobs.c.created_at)).label("newest"),
    func.sum(jobs.c.requests).label("requests"),
    func.sum(jobs.c.input_tokens).label("input_tokens"),
    func.count(_PARTS).label("with_parts"),
    func.coalesce(func.sum(_PARTS), 0).label("parts"),
    func.count(_TESTS).label("with_tests"),
    func.coalesce(func.sum(_TESTS), 0).label("tests"),
    func.sum(jobs.c.actions).label("actions"),
    func.sum(jobs.c.refused_actions).label("refused_actions"),
    func.string_agg(case((_OBJECT, cast(jobs.c.refusals, Text)), else_="{}"), "\n").label(
        "refusals"
    ),
]
"""Figures of each trial, all in one order, and sums."""


def _id_of(row: Row[Any]) -> CellId:
    return CellId(row.track, row.task, row.task_version, row.configuration)


def _tally_of(row: Row[Any]) -> Tally:
    # What an external agent used is unknown, which is not nothing.
    counted = 0 if row.external else row.number
    refusals: Counter[str] = Counter()
    for counts, times in Counter(row.refusals.split("\n")).items():
        refusals.update({name: int(count) * times for name, count in json.loads(counts).items()})
    return Tally(
        outcome=row.outcome,
        reason=row.reason,
        flags=tuple(row.flags),
        ran_on_runner=row.ran_on_runner,
        unverified=row.unverified,
        shares=_numbers(row.shares, ">f8"),
        indicators=_numbers(row.indicators, ">f8"),
        costs_usd=_numbers(row.costs, ">f8") if counted else np.full(row.number, np.nan),
        output_tokens=_numbers(row.output_tokens, ">i8")
        if counted
        else np.full(row.number, UNKNOWN_TOKENS),
        requests=Total(known=counted, sum=int(row.requests) if counted else 0),
        input_tokens=Total(known=counted, sum=int(row.input_tokens) if counted else 0),
        parts=Total(known=row.with_parts, sum=int(row.parts)),
        test_trials=Total(known=row.with_tests, sum=int(row.tests)),
        actions=int(row.actions),
        refused_actions=int(row.refused_actions),
        refusals=dict(refusals),
        newest=row.newest,
    )


def _numbers(sent: bytes, kind: str) -> NDArray[Any]:
    """Return the numbers as the database sends them, in the machine's order of bytes."""
    return np.frombuffer(sent, kind).astype(kind.replace(">", "="))
