"""Tables that are made of others: whatever is in them can be made again."""

from __future__ import annotations

from typing import Final

from sqlalchemy import (
    JSON,
    BigInteger,
    Column,
    DateTime,
    Index,
    Integer,
    LargeBinary,
    Numeric,
    Table,
    Text,
    TextClause,
    literal_column,
    text,
)
from sqlalchemy.dialects.postgresql import JSONB

from buildarena_backend.database.tables import metadata


def _snapshot() -> tuple[Column[str], Column[int], Column[int]]:
    """What had been committed; the later of two has the greater end, or fewer open before it."""
    return (
        Column("snapshot", Text, nullable=False),
        Column("snapshot_end", BigInteger, nullable=False),
        Column("snapshot_open", Integer, nullable=False),
    )


# What leaderboards are made of: made from jobs by whoever finds a cell changed, used by all.
board_cells = Table(
    "board_cells",
    metadata,
    # Programs of two releases may be at work: each has cells of its own format.
    Column("format", Integer, primary_key=True, autoincrement=False),
    Column("track", Text, primary_key=True),
    Column("task", Text, primary_key=True),
    Column("task_version", Text, primary_key=True),
    Column("configuration", Text, primary_key=True),
    Column("model", Text, nullable=False),
    Column("decoding", JSON, nullable=False),
    # None are left of a cell whose jobs all left; its row says so.
    Column("jobs", BigInteger, nullable=False),
    Column("newest", DateTime(timezone=True)),
    Column("tallies", JSON, nullable=False),
    Column("figures", LargeBinary, nullable=False),
    # Read for boards of a period alone.
    Column("details", LargeBinary, nullable=False, server_default=text("''")),
    # True as long as `summarised` names who made them, and the row's snapshot.
    Column("summaries", JSON),
    Column("samples", LargeBinary, nullable=False, server_default=text("''")),
    Column("summarised", Text),
    *_snapshot(),
)

# Up to when no cell of a format is missing or out of date.
board_state = Table(
    "board_state",
    metadata,
    Column("format", Integer, primary_key=True, autoincrement=False),
    Column("server", Text, nullable=False),
    *_snapshot(),
)


def _amounts() -> list[Column[object]]:
    return [Column(name, Numeric, nullable=False) for name in "abcd"]


# Counts of the whole service, and what triggers would add to them: rows that are only added need
# not wait for each other as one counter would make them.
figures = Table(
    "figures",
    metadata,
    Column("kind", Text, primary_key=True),
    Column("key", JSONB, primary_key=True),
    *_amounts(),
)
# A sweep's begin with its id.
Index("ix_figures_first", figures.c.key.op("->>")(literal_column("0")))
figure_changes = Table(
    "figure_changes",
    metadata,
    Column("kind", Text, nullable=False),
    Column("key", JSONB, nullable=False),
    *_amounts(),
)
OF_A_SWEEP: Final = "kind IN ('sweep_jobs', 'sweep_use', 'sweep_lost')"
"""The condition that figures are of a sweep: in which place its jobs are, what they used, and the
requests that were lost."""


def kept_figures(condition: str) -> TextClause:
    """The query for figures of which a condition holds: rows of kind, key, and a to d."""
    return text(
        f"""
        SELECT kind, key, sum(a) AS a, sum(b) AS b, sum(c) AS c, sum(d) AS d
        FROM (SELECT * FROM figures UNION ALL SELECT * FROM figure_changes) AS both_kinds
        WHERE {condition} GROUP BY kind, key ORDER BY kind, key
        """  # noqa: S608 - the conditions are constants of the program
    )
