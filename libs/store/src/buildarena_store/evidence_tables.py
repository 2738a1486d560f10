"""The table of what evenings with the game showed."""

from __future__ import annotations

from sqlalchemy import Column, DateTime, ForeignKey, Table, Text
from sqlalchemy.dialects.postgresql import JSONB

from buildarena_store.tables import metadata, time_column

# Files that people sent, each once; what they show was found here.
evidence = Table(
    "evidence",
    metadata,
    Column("hash", Text, ForeignKey("artifacts.hash"), primary_key=True),
    Column("made_at", DateTime(timezone=True), nullable=False),
    Column("judged", JSONB, nullable=False),
    Column("owner", Text),
    time_column("created_at", now=True),
)
