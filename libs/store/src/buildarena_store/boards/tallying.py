"""Cells with their tallies: made from jobs by the database, and kept as rows."""

from __future__ import annotations

from buildarena_geometry import kernels  # noqa: F401 - before numpy

# isort: split

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
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
    column,
    func,
    literal,
    literal_column,
    select,
)

from buildarena_benchmark.leaderboard import (
    ROBUST_INDICATOR,
    ROBUSTNESS,
    UNKNOWN_TOKENS,
    Tally,
    Total,
)
from buildarena_store.boards.trials import COUNTS, CellId, TrialFilter, decoding_of
from buildarena_store.rows import bound_texts
from buildarena_store.states import EXTERNAL_PROVIDER
from buildarena_store.tables import jobs

_FLOATS: Final = np.dtype(">f8")
_INTEGERS: Final = np.dtype(">i8")
"""As the database sends them."""
_ARRAYS: Final = 5
"""Figures of each trial that a row keeps."""


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
    """

    id: CellId
    model: str
    decoding: Mapping[str, Any]
    jobs: int
    newest: datetime | None
    tallies: Sequence[Tally]

    def without_tallies(self) -> CellRecord:
        """The same without what takes memory."""
        return replace(self, tallies=())


def tally_jobs(connection: Connection, wanted: TrialFilter) -> list[CellRecord]:
    """The cells of the jobs that are meant, made by two queries in one transaction."""
    conditions = wanted.conditions()
    refusals = _refusals(connection, conditions)
    found: dict[CellId, list[Row[Any]]] = {}
    for row in connection.execute(select(*_GROUPS, *_SUMS).where(*conditions).group_by(*_GROUPS)):
        found.setdefault(_id_of(row), []).append(row)
    samples = [rows[0].sample for rows in found.values()]
    configs = {row.id: row for row in connection.execute(_configs(samples))}
    records = []
    for id_, rows in found.items():
        config = configs[rows[0].sample]
        tallies = [_tally_of(row, refusals.get(_group_of(row), {})) for row in rows]
        records.append(_record(id_, config.model, decoding_of(config[2], config.limits), tallies))
    return records


def stored_tallies(tallies: Sequence[Tally]) -> tuple[list[dict[str, Any]], bytes]:
    """Tallies as a row keeps them: what is said once, and the figures of each trial."""
    said = [
        {
            "number": tally.number,
            "outcome": tally.outcome,
            "reason": tally.reason,
            "success": tally.success,
            "flags": list(tally.flags),
            "imported": tally.imported,
            "by_runner": tally.by_runner,
            "unverified": tally.unverified,
            "requests": asdict(tally.requests),
            "input_tokens": asdict(tally.input_tokens),
            "parts": asdict(tally.parts),
            "actions": tally.actions,
            "refused_actions": tally.refused_actions,
            "refusals": dict(tally.refusals),
            "newest": tally.newest.isoformat() if tally.newest else None,
        }
        for tally in tallies
    ]
    figures = [
        part.astype(kind).tobytes()
        for tally in tallies
        for part, kind in (
            (tally.indicators, _FLOATS),
            (tally.shares, _FLOATS),
            (tally.gained, _FLOATS),
            (tally.costs_usd, _FLOATS),
            (tally.output_tokens, _INTEGERS),
        )
    ]
    return said, b"".join(figures)


def tallies_of(said: Sequence[Mapping[str, Any]], figures: bytes) -> list[Tally]:
    """The same back from a row."""
    tallies, start = [], 0
    for one in said:
        size = 8 * one["number"]
        parts = [
            figures[start + place * size : start + (place + 1) * size] for place in range(_ARRAYS)
        ]
        start += _ARRAYS * size
        tallies.append(
            Tally(
                outcome=one["outcome"],
                reason=one["reason"],
                success=one["success"],
                flags=tuple(one["flags"]),
                imported=one["imported"],
                by_runner=one["by_runner"],
                unverified=one["unverified"],
                indicators=_floats(parts[0]),
                shares=_floats(parts[1]),
                gained=_floats(parts[2]),
                costs_usd=_floats(parts[3]),
                output_tokens=_integers(parts[4]),
                requests=Total(**one["requests"]),
                input_tokens=Total(**one["input_tokens"]),
                parts=Total(**one["parts"]),
                actions=one["actions"],
                refused_actions=one["refused_actions"],
                refusals=one["refusals"],
                newest=datetime.fromisoformat(one["newest"]) if one["newest"] else None,
            )
        )
    return tallies


_EXTERNAL: Final = func.coalesce(
    jobs.c.model_config["provider"].as_string() == EXTERNAL_PROVIDER, False
)
_PARTS: Final = cast(jobs.c.metrics["parts"], BigInteger)
_IMPORTED: Final = jobs.c.imported_from.is_not(None)
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
    _IMPORTED.label("imported"),
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
_SUMS: Final = [
    func.min(jobs.c.id).label("sample"),
    func.count().label("number"),
    _bytes_of(func.float8send(func.coalesce(jobs.c.indicator, 0.0))).label("indicators"),
    _bytes_of(func.float8send(_SHARE)).label("shares"),
    _bytes_of(func.float8send(_GAINED)).label("gained"),
    _bytes_of(func.float8send(cast(jobs.c.cost_usd, Double))).label("costs"),
    _bytes_of(func.int8send(jobs.c.output_tokens)).label("output_tokens"),
    func.sum(jobs.c.requests).label("requests"),
    func.sum(jobs.c.input_tokens).label("input_tokens"),
    func.count(_PARTS).label("with_parts"),
    func.sum(_PARTS).label("parts"),
    func.sum(jobs.c.actions).label("actions"),
    func.sum(jobs.c.refused_actions).label("refused_actions"),
    func.max(jobs.c.finished_at).label("newest"),
]


def _refusals(connection: Connection, conditions: Sequence[Any]) -> dict[Any, dict[str, int]]:
    is_object = func.jsonb_typeof(jobs.c.refusals) == "object"
    said = func.jsonb_each_text(case((is_object, jobs.c.refusals))).table_valued(
        column("key", Text), column("value", Text), name="said"
    )
    query = (
        select(*_GROUPS, said.c.key, func.sum(cast(said.c.value, BigInteger)).label("refused"))
        .select_from(jobs.join(said, literal(True)))
        .where(*conditions)
        .group_by(*_GROUPS, said.c.key)
    )
    found: dict[Any, dict[str, int]] = {}
    for row in connection.execute(query):
        found.setdefault(_group_of(row), {})[row.key] = int(row.refused)
    return found


def _group_of(row: Any) -> tuple[Any, ...]:
    return (
        *_id_of(row), row.outcome, row.reason, row.success, tuple(row.flags),
        row.imported, row.by_runner, row.unverified, row.external,
    )  # fmt: skip


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


def _tally_of(row: Row[Any], refusals: Mapping[str, int]) -> Tally:
    number = row.number
    # What an external agent used is unknown, which is not nothing.
    known = 0 if row.external else number
    return Tally(
        outcome=row.outcome,
        reason=row.reason,
        success=row.success,
        flags=tuple(row.flags),
        imported=row.imported,
        by_runner=row.by_runner,
        unverified=row.unverified,
        indicators=_floats(row.indicators),
        shares=_floats(row.shares),
        gained=_floats(row.gained),
        costs_usd=_floats(row.costs) if known else np.full(number, np.nan),
        output_tokens=_integers(row.output_tokens) if known else np.full(number, UNKNOWN_TOKENS),
        requests=Total(known=known, sum=int(row.requests) if known else 0),
        input_tokens=Total(known=known, sum=int(row.input_tokens) if known else 0),
        parts=Total(known=row.with_parts, sum=int(row.parts or 0)),
        actions=int(row.actions),
        refused_actions=int(row.refused_actions),
        refusals=dict(refusals),
        newest=row.newest,
    )


def _record(
    id_: CellId, model: str, decoding: Mapping[str, Any], tallies: Sequence[Tally]
) -> CellRecord:
    return CellRecord(
        id=id_,
        model=model,
        decoding=decoding,
        jobs=sum(tally.number for tally in tallies),
        newest=max((tally.newest for tally in tallies if tally.newest), default=None),
        tallies=tallies,
    )


def _floats(data: bytes) -> NDArray[np.float64]:
    return np.frombuffer(data, _FLOATS).astype(np.float64)


def _integers(data: bytes) -> NDArray[np.int64]:
    return np.frombuffer(data, _INTEGERS).astype(np.int64)
