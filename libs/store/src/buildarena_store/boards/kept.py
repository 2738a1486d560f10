"""Rows of cells: what each was in one snapshot of the database."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from typing import Any, Final, NamedTuple

from sqlalchemy import (
    BigInteger,
    ColumnElement,
    Connection,
    Table,
    Text,
    and_,
    case,
    cast,
    exists,
    func,
    literal,
    select,
    tuple_,
    update,
)
from sqlalchemy.dialects.postgresql import Insert, insert
from sqlalchemy.types import UserDefinedType

from buildarena_benchmark.leaderboard import summaries_made_by
from buildarena_store.boards.packing import (
    pack_details,
    pack_tallies,
    unpack_details,
    unpack_tallies,
)
from buildarena_store.boards.summaries import pack_summary, unpack_summary
from buildarena_store.boards.tallying import CellRecord
from buildarena_store.boards.trials import CellId
from buildarena_store.database import AS_THEY_ARE
from buildarena_store.derived_tables import board_cells
from buildarena_store.rows import bound_texts
from buildarena_store.tables import board_changes

FORMAT: Final = 8
"""Of rows; programs of different formats may use one database at once."""


class Mark(NamedTuple):
    """A snapshot: what had been committed when something was read. Later ones are greater."""

    end: int
    closed: int
    snapshot: str

    @staticmethod
    def of(snapshot: str) -> Mark:
        """The mark of a snapshot as the database writes it."""
        _, end, open_ = snapshot.split(":")
        return Mark(int(end), -len(open_.split(",")) if open_ else 0, snapshot)


class _PgSnapshot(UserDefinedType[str]):
    cache_ok = True

    def get_col_spec(self, **_: Any) -> str:
        return "pg_snapshot"


class _Xid8(UserDefinedType[str]):
    cache_ok = True

    def get_col_spec(self, **_: Any) -> str:
        return "xid8"


def since(snapshot: Any) -> ColumnElement[bool]:
    """Changes by transactions that a snapshot did not see."""
    given = cast(snapshot, _PgSnapshot)
    transaction = cast(cast(board_changes.c.transaction, Text), _Xid8)
    return and_(
        board_changes.c.transaction >= cast(cast(func.pg_snapshot_xmin(given), Text), BigInteger),
        ~func.pg_visible_in_snapshot(transaction, given),
    )


def read_rows(
    connection: Connection,
    ids: Collection[CellId] | None,
    *,
    tallies: bool = False,
    details: bool = False,
    summaries: bool = False,
    only_fresh: bool = True,
) -> list[CellRecord]:
    """Cells as rows have them; of some that changed, only those made after the change.

    Args:
        connection: Where they are read.
        ids: Which; None for all.
        tallies: With their tallies.
        details: With what these are made of.
        summaries: With their summaries, unless these are others than would be made today.
        only_fresh: Leave out those that changed since.
    """
    here = board_cells.c
    key = [here[name] for name in CellId._fields]
    columns: list[Any] = [*key, here.model, here.decoding, here.jobs, here.newest, here.snapshot]
    if tallies:
        columns += [here.tallies, here.figures]
    if details:
        columns.append(here.details)
    if summaries:
        of_today = here.summarised == literal(f"{summaries_made_by()} ") + here.snapshot
        columns += [case((of_today, here.summaries)).label("summaries"), here.samples]
    query = select(*columns).where(here.format == FORMAT)
    if ids is not None:
        if not ids:
            return []
        given = [bound_texts(list(values)) for values in zip(*sorted(ids), strict=True)]
        wanted = func.unnest(*given).table_valued(*CellId._fields).render_derived(name="wanted")
        query = query.join(wanted, and_(*(a == b for a, b in zip(key, wanted.c, strict=True))))
        if only_fresh:
            log = [board_changes.c[name] for name in CellId._fields]
            same = and_(*(a == b for a, b in zip(log, key, strict=True)))
            query = query.where(~exists().where(same, since(here.snapshot)))
    found = []
    for row in connection.execute(query, execution_options=AS_THEY_ARE):
        record = CellRecord(
            id=CellId(row.track, row.task, row.task_version, row.configuration),
            model=row.model,
            decoding=row.decoding,
            jobs=row.jobs,
            newest=row.newest,
            tallies=unpack_tallies(row.tallies, row.figures) if tallies else (),
            details=unpack_details(row.tallies, row.details) if details else (),
            snapshot=row.snapshot,
        )
        if summaries:
            made = unpack_summary(record.name, row.summaries, row.samples)
            record = replace(record, summary=made)
        found.append(record)
    return found


def row_of(record: CellRecord, mark: Mark) -> dict[str, Any]:
    """A cell's row as of a mark."""
    tallies, figures = pack_tallies(record.tallies)
    return {
        "format": FORMAT,
        **record.id._asdict(),
        "model": record.model,
        "decoding": dict(record.decoding),
        "jobs": record.jobs,
        "newest": record.newest,
        "tallies": tallies,
        "figures": figures,
        "details": pack_details(record.details),
        **_summary_columns(record, mark.snapshot),
        **mark_columns(mark),
    }


def keep_summary(connection: Connection, record: CellRecord) -> None:
    """Keeps a record's summary, unless its row is another one by now."""
    own = {"format": FORMAT, **record.id._asdict(), "snapshot": record.snapshot}
    here = (board_cells.c[name] == value for name, value in own.items())
    values = _summary_columns(record, record.snapshot)
    connection.execute(update(board_cells).where(*here).values(values))


def _summary_columns(record: CellRecord, snapshot: str) -> dict[str, Any]:
    said, samples = pack_summary(record.summary)
    return {
        "summaries": said,
        "samples": samples,
        "summarised": f"{summaries_made_by()} {snapshot}",
    }


def mark_columns(mark: Mark) -> dict[str, Any]:
    """Columns of whatever was so as of a mark."""
    return {
        "snapshot": mark.snapshot,
        "snapshot_end": mark.end,
        "snapshot_open": -mark.closed,
    }


def upsert(table: Table, row: dict[str, Any]) -> Insert:
    """Writes a row unless there is one of a later snapshot."""
    statement = insert(table).values(row)
    key = [column.name for column in table.primary_key]
    new = statement.excluded
    return statement.on_conflict_do_update(
        index_elements=key,
        set_={name: new[name] for name in row if name not in key},
        where=tuple_(table.c.snapshot_end, -table.c.snapshot_open)
        <= tuple_(new.snapshot_end, -new.snapshot_open),
    )
