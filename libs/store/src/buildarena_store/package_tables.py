"""The tables of what people hand in to challenges."""

from __future__ import annotations

from sqlalchemy import (
    BigInteger,
    Column,
    Double,
    ForeignKey,
    Identity,
    Index,
    Integer,
    Table,
    Text,
    text,
)
from sqlalchemy.dialects.postgresql import ARRAY, JSONB

from buildarena_store.tables import metadata, time_column

# What somebody handed in, each file once for each season and owner.
packages = Table(
    "packages",
    metadata,
    Column("id", Text, primary_key=True),
    Column("season", Text, nullable=False),
    Column("track", Text, nullable=False),
    Column("name", Text, nullable=False),
    Column("owner", Text, nullable=False, server_default=text("''")),
    Column("hash", Text, ForeignKey("artifacts.hash"), nullable=False),
    Column("state", Text, nullable=False),
    Column("reason", Text),
    # What the checks said; the rules that they went by.
    Column("report", JSONB),
    Column("rules", Text),
    # By these packages are ranked, and near-copies found.
    Column("points", Double),
    Column("cost", Integer),
    Column("fingerprints", ARRAY(Text), nullable=False, server_default=text("'{}'::text[]")),
    time_column("created_at", now=True),
    time_column("claimed_at"),
    time_column("checked_at"),
    Index("uq_packages_season_owner_hash", "season", "owner", "hash", unique=True),
    Index(
        "ix_packages_unchecked",
        "created_at",
        postgresql_where=text("state IN ('received', 'checking')"),
    ),
    Index("ix_packages_season_created_at", "season", "created_at"),
)

# Who changed what of a package, and why; nothing of it is ever changed.
package_changes = Table(
    "package_changes",
    metadata,
    Column("id", BigInteger, Identity(always=True), primary_key=True),
    Column("package", Text, ForeignKey("packages.id"), nullable=False),
    Column("changed_by", Text, nullable=False, server_default=text("''")),
    Column("state_before", Text, nullable=False),
    Column("state", Text, nullable=False),
    Column("reason", Text, nullable=False),
    time_column("at", now=True),
    Index("ix_package_changes_package", "package"),
)
