"""Tables that are made of others: whatever is in them can be made again."""

from __future__ import annotations

from typing import Final

from sqlalchemy import (
    Column,
    Index,
    Numeric,
    Table,
    Text,
    TextClause,
    literal_column,
    text,
)
from sqlalchemy.dialects.postgresql import JSONB

from buildarena_backend.database.tables import metadata


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
