"""Cells that processes share: found changed by the log, made anew by one, read by all.

A row of `board_cells` says what its cell was in one snapshot of the database. The row of
`board_state` says up to which snapshot no cell is missing or out of date; the log of changes says
which cells changed since. Snapshots rather than ids or times, as transactions become visible out
of order.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Final

from sqlalchemy import (
    BigInteger,
    Connection,
    Text,
    cast,
    delete,
    distinct,
    func,
    select,
    text,
    update,
)

from buildarena_backend.boards.kept import (
    FORMAT,
    Mark,
    keep_summary,
    mark_columns,
    read_rows,
    row_of,
    since,
    upsert,
)
from buildarena_backend.boards.tallying import CellRecord, tally_jobs
from buildarena_backend.boards.trials import RANKED, CellId, TrialFilter
from buildarena_backend.database.database import Database
from buildarena_backend.database.derived_tables import board_cells, board_state
from buildarena_backend.database.tables import board_changes, jobs, tasks
from buildarena_backend.states import JobState
from buildarena_benchmark.leaderboard import Cell

FILL_LOCK: Final = 0x63656C6C73  # "cells": of processes that find none, one makes them
MAX_STORED_AT_ONCE: Final = 50
"""Cells that are made or read before the next ones, so that memory stays small."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CellFeed:
    """What changed since a mark, or all there is.

    Attributes:
        mark: Give it to read on from here.
        cells: Cells that changed, with their summary if it was made, or all; none has its
            tallies, and those with no jobs are gone.
        whole: Whether it is all there is.
        task_versions: How many versions of tasks were ever uploaded.
    """

    mark: Mark
    cells: Sequence[CellRecord]
    whole: bool
    task_versions: int


class BoardCells:
    """Reads cells, and makes those anew that changed."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def feed(self, mark: Mark | None) -> CellFeed:
        """All cells, or those that changed since a mark.

        Args:
            mark: Of the last feed; None for all.
        """
        if mark is not None:
            with self._database.statement() as connection:
                now, task_versions, changed = _look(connection, mark)
            if now.end < mark.end:
                # The database is an older one than it was: a backup was restored.
                mark = None
            elif not changed:
                return CellFeed(mark=now, cells=(), whole=False, task_versions=task_versions)
        state = mark or self._settled()
        with self._reading() as connection:
            now, task_versions, changed = _look(connection, state)
            fresh = read_rows(connection, changed, summaries=True)
            made = _made(connection, sorted(changed - {record.id for record in fresh}))
            kept = [] if mark else read_rows(connection, None)
        if made:
            made = [record.summarised() for record in made]
            self._keep(made, now, settled=True)
        known = {record.id for record in (*fresh, *made)}
        whole = [record for record in kept if record.id not in known and record.jobs]
        return CellFeed(
            mark=now,
            cells=[*whole, *fresh, *(record.without_tallies() for record in made)],
            whole=mark is None,
            task_versions=task_versions,
        )

    def read(self, ids: Collection[CellId], *, details: bool = False) -> Iterator[CellRecord]:
        """Cells with their tallies, as of the last feed or later.

        Args:
            ids: Which.
            details: Also what the tallies' totals are made of.
        """
        ordered = sorted(ids)
        for start in range(0, len(ordered), MAX_STORED_AT_ONCE):
            with self._database.statement() as connection:
                some = ordered[start : start + MAX_STORED_AT_ONCE]
                found = read_rows(connection, some, tallies=True, details=details, only_fresh=False)
            yield from found

    def summaries(self, ids: Collection[CellId]) -> Iterator[tuple[CellId, Cell]]:
        """What boards show of cells, as of the last feed or later; cells without jobs have none.

        Those that another release made are made again, and kept.

        Args:
            ids: Which.
        """
        ordered = sorted(ids)
        for start in range(0, len(ordered), MAX_STORED_AT_ONCE):
            some = ordered[start : start + MAX_STORED_AT_ONCE]
            with self._database.statement() as connection:
                found = read_rows(connection, some, summaries=True, only_fresh=False)
            old = [record.id for record in found if record.jobs and record.summary is None]
            for record in (*found, *(self._summarised(old) if old else ())):
                if record.summary is not None:
                    yield record.id, record.summary

    def of(self, wanted: TrialFilter) -> list[CellRecord]:
        """Cells of just the jobs that are meant: they are made for this question alone."""
        with self._reading() as connection:
            return tally_jobs(connection, wanted)

    def _summarised(self, ids: Sequence[CellId]) -> list[CellRecord]:
        """Cells with summaries that are made now, and kept in rows that did not change since."""
        with self._database.statement() as connection:
            read = read_rows(connection, ids, tallies=True, only_fresh=False)
        records = [record.summarised() for record in sorted(read, key=lambda one: one.id)]
        with self._keeping() as connection:
            for record in records:
                keep_summary(connection, record)
        return records

    @contextmanager
    def _reading(self) -> Iterator[Connection]:
        with self._database.transaction() as connection:
            connection.execute(text("SET TRANSACTION ISOLATION LEVEL REPEATABLE READ, READ ONLY"))
            # One plan for any number of cells would be a bad one for few or for many.
            connection.execute(text("SET LOCAL plan_cache_mode = force_custom_plan"))
            yield connection

    @contextmanager
    def _keeping(self) -> Iterator[Connection]:
        with self._database.transaction() as connection:
            # What is lost with the server's memory is made again.
            connection.execute(text("SET LOCAL synchronous_commit = off"))
            yield connection

    def _settled(self) -> Mark:
        """The mark up to which all cells are kept; makes them when nobody has."""
        with self._database.transaction() as connection:
            if (state := _state(connection)) is not None:
                return state
        with self._database.transaction() as waiting:
            waiting.execute(select(func.pg_advisory_xact_lock(FILL_LOCK)))
            # Another process may have made them while this one waited.
            with self._database.transaction() as connection:
                state = _state(connection)
                if state is None:
                    _forget(connection)
            return state or self._fill()

    def _fill(self) -> Mark:
        with self._reading() as connection:
            mark = Mark.of(str(connection.execute(select(_SNAPSHOT)).scalar_one()))
            names = select(jobs.c.track, jobs.c.task).where(jobs.c.state == JobState.DONE, RANKED)
            for track, task in connection.execute(names.distinct()).all():
                made = tally_jobs(connection, TrialFilter(track=track, tasks=[task]))
                self._keep([record.summarised() for record in made], mark)
        self._keep([], mark, settled=True)
        return mark

    def _keep(self, records: Sequence[CellRecord], mark: Mark, *, settled: bool = False) -> None:
        """Keeps cells as they were at a mark; later ones of another process stay.

        Args:
            records: The cells.
            mark: When they were so.
            settled: Whether all other cells are kept up to then, too.
        """
        with self._keeping() as connection:
            # In one order, so that no two processes wait for each other.
            for record in sorted(records, key=lambda one: one.id):
                connection.execute(upsert(board_cells, row_of(record, mark)))
            if settled:
                row = {"format": FORMAT, "server": _server(connection), **mark_columns(mark)}
                connection.execute(upsert(board_state, row))


_SNAPSHOT: Final = cast(func.pg_current_snapshot(), Text)


def _forget(connection: Connection) -> None:
    """Forgets cells of another server, and its transactions: their numbers mean nothing here."""
    for table in (board_cells, board_state):
        # Programs of the format before may be at work; of earlier ones there are none.
        theirs = table.c.format == FORMAT - 1
        connection.execute(delete(table).where(table.c.format <= FORMAT, ~theirs))
    # No transaction of this server that can be seen has such a number.
    begun = cast(cast(func.pg_snapshot_xmax(func.pg_current_snapshot()), Text), BigInteger)
    foreign = update(board_changes).where(board_changes.c.transaction >= begun)
    connection.execute(foreign.values(transaction=0))


def _look(connection: Connection, mark: Mark) -> tuple[Mark, int, set[CellId]]:
    """What is committed now, how many task versions there are, and which cells changed."""
    key = [board_changes.c[name] for name in CellId._fields]
    changed = (
        select(func.jsonb_agg(distinct(func.jsonb_build_array(*key))))
        .where(since(mark.snapshot), board_changes.c.configuration.is_not(None))
        .scalar_subquery()
    )
    uploaded = select(func.count()).select_from(tasks).scalar_subquery()
    snapshot, task_versions, found = connection.execute(select(_SNAPSHOT, uploaded, changed)).one()
    return Mark.of(str(snapshot)), int(task_versions), {CellId(*one) for one in found or ()}


def _made(connection: Connection, ids: Sequence[CellId]) -> list[CellRecord]:
    """Cells made from their jobs; those that have none left are without jobs."""
    made: list[CellRecord] = []
    for start in range(0, len(ids), MAX_STORED_AT_ONCE):
        some = ids[start : start + MAX_STORED_AT_ONCE]
        made += tally_jobs(connection, TrialFilter(cells=some))
    gone = set(ids) - {record.id for record in made}
    return made + [
        CellRecord(id=id_, model="", decoding={}, jobs=0, newest=None, tallies=())
        for id_ in sorted(gone)
    ]


def _state(connection: Connection) -> Mark | None:
    query = select(board_state.c.snapshot).where(
        board_state.c.format == FORMAT, board_state.c.server == _server(connection)
    )
    found = connection.execute(query).scalar()
    return None if found is None else Mark.of(found)


def _server(connection: Connection) -> str:
    """Which server's transactions the marks count."""
    query = text("SELECT system_identifier::text FROM pg_control_system()")
    return str(connection.execute(query).scalar_one())
