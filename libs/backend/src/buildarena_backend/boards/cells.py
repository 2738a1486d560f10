"""Cells of leaderboards: computed from their jobs by one query, with changes from the log.

Snapshots rather than ids or times show what was committed since an earlier look, as transactions
become visible out of order.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Final

from sqlalchemy import BigInteger, Connection, Text, cast, func, literal, select, text
from sqlalchemy.types import UserDefinedType

from buildarena_backend.boards.tallies import CellRecord, cell_record, tally_jobs
from buildarena_backend.boards.trials import CellId, TrialFilter
from buildarena_backend.database.database import Database
from buildarena_backend.database.tables import board_changes, tasks


@dataclass(frozen=True, slots=True, kw_only=True)
class CellFeed:
    """Cells that changed since a mark, or all cells.

    Attributes:
        mark: Pass it to continue from here.
        cells: Cells that changed, or all; those without jobs were removed.
        complete: Whether it contains all cells.
    """

    mark: str
    cells: Sequence[CellRecord]
    complete: bool
    task_versions: int


class BoardCells:
    """Reads cells, and those again that changed."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def feed(self, mark: str | None) -> CellFeed:
        """Return all cells, or those that changed since a mark.

        Args:
            mark: Mark of the last feed; None for all.
        """
        if mark is not None:
            with self._database.statement() as connection:
                now, task_versions, changed = _look(connection, mark)
            if _end(now) < _end(mark):
                # The database is an older one than it was: a backup was restored.
                mark = None
            elif not changed:
                return CellFeed(mark=now, cells=(), complete=False, task_versions=task_versions)
        with self._reading() as connection:
            now, task_versions, changed = _look(connection, mark)
            cells = tally_jobs(connection, TrialFilter(cells=changed if mark else None))
        gone = changed - {cell.id for cell in cells}
        return CellFeed(
            mark=now,
            cells=[*cells, *(cell_record(id_, "", {}, []) for id_ in sorted(gone))],
            complete=mark is None,
            task_versions=task_versions,
        )

    def of(self, trial_filter: TrialFilter) -> list[CellRecord]:
        """Return the cells of just these jobs."""
        with self._reading() as connection:
            return tally_jobs(connection, trial_filter)

    @contextmanager
    def _reading(self) -> Iterator[Connection]:
        with self._database.transaction() as connection:
            connection.execute(text("SET TRANSACTION ISOLATION LEVEL REPEATABLE READ, READ ONLY"))
            # One plan for any number of cells would be a bad one for few or for many.
            connection.execute(text("SET LOCAL plan_cache_mode = force_custom_plan"))
            yield connection


class _PgSnapshot(UserDefinedType[str]):
    cache_ok = True

    def get_col_spec(self, **_: Any) -> str:
        return "pg_snapshot"


class _Xid8(UserDefinedType[str]):
    cache_ok = True

    def get_col_spec(self, **_: Any) -> str:
        return "xid8"


_SNAPSHOT: Final = cast(func.pg_current_snapshot(), Text)


def _look(connection: Connection, mark: str | None) -> tuple[str, int, set[CellId]]:
    """Return the committed mark, the number of task versions, and the changed cells."""
    uploaded = select(func.count()).select_from(tasks).scalar_subquery()
    if mark is None:
        now, task_versions = connection.execute(select(_SNAPSHOT, uploaded)).one()
        return now, task_versions, set()
    snapshot = cast(literal(mark), _PgSnapshot)
    transaction = board_changes.c.transaction
    key = [board_changes.c[name] for name in CellId._fields]
    changed = (
        select(func.jsonb_agg(func.distinct(func.jsonb_build_array(*key))))
        .where(
            transaction >= cast(cast(func.pg_snapshot_xmin(snapshot), Text), BigInteger),
            ~func.pg_visible_in_snapshot(cast(cast(transaction, Text), _Xid8), snapshot),
            board_changes.c.configuration.is_not(None),
        )
        .scalar_subquery()
    )
    now, task_versions, cells = connection.execute(select(_SNAPSHOT, uploaded, changed)).one()
    return now, task_versions, {CellId(*cell) for cell in cells or ()}


def _end(snapshot: str) -> int:
    """Return the first transaction that had not begun when a snapshot was taken."""
    return int(snapshot.split(":")[1])
