"""Cells with their tallies: made from jobs by the database, and kept as rows."""

from __future__ import annotations

from buildarena_geometry import kernels  # noqa: F401 - before numpy

# isort: split

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from sqlalchemy import (
    BigInteger,
    Column,
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

from buildarena_backend.boards.packing import floats, integers
from buildarena_backend.boards.trials import COUNTS, CellId, TrialFilter, decoding_of, published
from buildarena_backend.database.database import AS_THEY_ARE
from buildarena_backend.database.rows import bound_texts
from buildarena_backend.database.tables import jobs
from buildarena_backend.states import EXTERNAL_PROVIDER
from buildarena_benchmark.leaderboard import (
    DETAILS,
    ROBUST_INDICATOR,
    ROBUSTNESS,
    UNKNOWN_TOKENS,
    Cell,
    CellName,
    Details,
    Tally,
    summarise_tallies,
    tally_between,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class CellRecord:
    """A cell as boards are made of it.

    Attributes:
        id: Which cell.
        model: Its model's name.
        decoding: How the model's replies were sampled, and the limits of its sessions, if any.
        jobs: How many ended jobs it has; 0 when all have left.
        newest: When the last of them ended.
        tallies: What its figures are made of.
        details: Of each tally, what its totals are made of; not read with others than those of a
            period.
        summary: What boards show of it, if that was made.
        snapshot: When its row was so, in the database's words; empty of one that is not a row's.
    """

    id: CellId
    model: str
    decoding: Mapping[str, Any]
    jobs: int
    newest: datetime | None
    tallies: Sequence[Tally]
    details: Sequence[Details] = ()
    summary: Cell | None = None
    snapshot: str = ""

    @property
    def name(self) -> CellName:
        """Whose trials it has."""
        return CellName(
            task=self.id.task,
            model=self.model,
            configuration=self.id.configuration,
            decoding=self.decoding,
        )

    def summarise(self) -> Cell:
        """What boards show of it; made of its tallies."""
        return summarise_tallies(self.name, self.tallies)

    def summarised(self) -> CellRecord:
        """The same with its summary, if it has jobs."""
        return replace(self, summary=self.summarise()) if self.jobs else self

    def without_tallies(self) -> CellRecord:
        """The same without what takes memory."""
        return replace(self, tallies=(), details=())

    def between(self, since: datetime | None, until: datetime | None) -> CellRecord:
        """The same of the jobs that ended in a period; needs the details."""
        pairs = zip(self.tallies, self.details, strict=True)
        tallies = [tally_between(tally, details, since, until) for tally, details in pairs]
        return cell_record(self.id, self.model, self.decoding, [t for t in tallies if t.number])


def cell_record(
    id_: CellId,
    model: str,
    decoding: Mapping[str, Any],
    tallies: Sequence[Tally],
    details: Sequence[Details] = (),
) -> CellRecord:
    """The cell of some tallies."""
    return CellRecord(
        id=id_,
        model=model,
        decoding=decoding,
        jobs=sum(tally.number for tally in tallies),
        newest=max((tally.newest for tally in tallies if tally.newest), default=None),
        tallies=tallies,
        details=details,
    )


def tally_jobs(connection: Connection, wanted: TrialFilter) -> list[CellRecord]:
    """The cells of the jobs that are meant, made by two queries in one transaction."""
    found: dict[CellId, list[Row[Any]]] = {}
    exact = func.coalesce(published(), jobs.c.indicator, 0.0)  # as `EndedJob.as_published`
    indicators = _bytes_of(func.float8send(exact)).label("indicators")
    figures: list[Any] = [*_GROUPS, indicators, *_EACH]
    query = select(*figures).where(*wanted.conditions()).group_by(*_GROUPS)
    for row in connection.execute(query, execution_options=AS_THEY_ARE):
        found.setdefault(_id_of(row), []).append(row)
    samples = [rows[0].sample for rows in found.values()]
    configs = {row.id: row for row in connection.execute(_configs(samples))}
    records = []
    for id_, rows in found.items():
        config = configs[rows[0].sample]
        details = [_details_of(row) for row in rows]
        tallies = [_tally_of(row, own) for row, own in zip(rows, details, strict=True)]
        decoding = decoding_of(config[2], config.limits)
        records.append(cell_record(id_, config.model, decoding, tallies, details))
    return records


_EXTERNAL: Final = func.coalesce(
    jobs.c.model_config["provider"].as_string() == EXTERNAL_PROVIDER, False
)
_PARTS: Final = cast(jobs.c.metrics["parts"], BigInteger)
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
    func.coalesce(jobs.c.success, False).label("success"),
    func.coalesce(
        func.nullif(jobs.c.flags, literal_column("'null'::jsonb")), literal_column("'[]'::jsonb")
    ).label("flags"),
    jobs.c.by_runner,
    (~COUNTS).label("unverified"),
    _EXTERNAL.label("external"),
]


def _bytes_of(sent: Any) -> Any:
    return func.string_agg(sent, cast(literal(b"", LargeBinary), LargeBinary), type_=LargeBinary)


_SUCCESS: Final = func.coalesce(jobs.c.success, False)
_SHARE: Final = func.coalesce(
    jobs.c.metrics[ROBUSTNESS].as_float(), case((_SUCCESS, 1.0), else_=0.0)
)
_GAINED: Final = func.coalesce(
    jobs.c.metrics[ROBUST_INDICATOR].as_float(), case((_SUCCESS, jobs.c.indicator), else_=0.0), 0.0
)
"""As `EndedJob.share` and `EndedJob.gained`."""
_OBJECT: Final = func.jsonb_typeof(jobs.c.refusals) == "object"
_EACH: Final = [
    func.min(jobs.c.id).label("sample"),
    func.count().label("number"),
    _bytes_of(func.float8send(_SHARE)).label("shares"),
    _bytes_of(func.float8send(_GAINED)).label("gained"),
    _bytes_of(func.float8send(cast(jobs.c.cost_usd, Double))).label("costs"),
    _bytes_of(func.int8send(jobs.c.output_tokens)).label("output_tokens"),
    _bytes_of(func.timestamptz_send(func.coalesce(jobs.c.finished_at, jobs.c.created_at))).label(
        "finished_us"
    ),
    _bytes_of(func.int8send(jobs.c.requests)).label("requests"),
    _bytes_of(func.int8send(jobs.c.input_tokens)).label("input_tokens"),
    _bytes_of(func.int8send(func.coalesce(_PARTS, UNKNOWN_TOKENS))).label("parts"),
    _bytes_of(func.int8send(jobs.c.actions)).label("actions"),
    _bytes_of(func.int8send(jobs.c.refused_actions)).label("refused_actions"),
    func.string_agg(case((_OBJECT, cast(jobs.c.refusals, Text)), else_="{}"), "\n").label(
        "refusals"
    ),
]
"""Figures of each trial, all in one order."""


def _id_of(row: Row[Any]) -> CellId:
    return CellId(row.track, row.task, row.task_version, row.configuration)


def _configs(ids: Sequence[str]) -> Any:
    columns: list[Column[Any] | Any] = [
        jobs.c.id,
        jobs.c.model,
        jobs.c.model_config["decoding"].label("decoding"),
        jobs.c.limits,
    ]
    return select(*columns).where(jobs.c.id == func.any(bound_texts(ids)))


def _details_of(row: Row[Any]) -> Details:
    details = np.stack([integers(getattr(row, name)) for name in DETAILS])
    if row.external:
        # What an external agent used is unknown, which is not nothing.
        details[[DETAILS.index("requests"), DETAILS.index("input_tokens")]] = UNKNOWN_TOKENS
    return Details(columns=details, refusals=_refusals(row.refusals.split("\n")))


def _refusals(texts: Sequence[str]) -> dict[str, NDArray[np.int64]]:
    """Refused actions of each trial by class."""
    places = {text: place for place, text in enumerate(dict.fromkeys(texts))}
    distinct = [json.loads(text) for text in places]
    place = np.array([places[text] for text in texts])
    classes = sorted({name for one in distinct for name in one})
    return {
        name: np.array([int(one.get(name, 0)) for one in distinct], np.int64)[place]
        for name in classes
    }


def _tally_of(row: Row[Any], details: Details) -> Tally:
    number = row.number
    return Tally(
        outcome=row.outcome,
        reason=row.reason,
        success=row.success,
        flags=tuple(row.flags),
        by_runner=row.by_runner,
        unverified=row.unverified,
        indicators=floats(row.indicators),
        shares=floats(row.shares),
        gained=floats(row.gained),
        costs_usd=np.full(number, np.nan) if row.external else floats(row.costs),
        output_tokens=np.full(number, UNKNOWN_TOKENS)
        if row.external
        else integers(row.output_tokens),
        **details.totals(),
    )
