"""packages: what people hand in to challenges, and who changed what of it."""

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects.postgresql import ARRAY, JSONB

revision = "2026_11_26_packages"
down_revision = "2026_11_25_evidence"
branch_labels = None
depends_on = None


def _time(name: str, *, now: bool = False) -> sa.Column[object]:
    default = sa.text("clock_timestamp()") if now else None
    return sa.Column(name, sa.DateTime(timezone=True), server_default=default, nullable=not now)


def upgrade() -> None:
    op.create_table(
        "packages",
        sa.Column("id", sa.Text(), nullable=False),
        sa.Column("season", sa.Text(), nullable=False),
        sa.Column("track", sa.Text(), nullable=False),
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("owner", sa.Text(), server_default=sa.text("''"), nullable=False),
        sa.Column("hash", sa.Text(), nullable=False),
        sa.Column("state", sa.Text(), nullable=False),
        sa.Column("reason", sa.Text()),
        sa.Column("report", JSONB()),
        sa.Column("rules", sa.Text()),
        sa.Column("points", sa.Double()),
        sa.Column("cost", sa.Integer()),
        sa.Column(
            "fingerprints", ARRAY(sa.Text()), server_default=sa.text("'{}'::text[]"), nullable=False
        ),
        _time("created_at", now=True),
        _time("claimed_at"),
        _time("checked_at"),
        sa.ForeignKeyConstraint(
            ["hash"], ["artifacts.hash"], name=op.f("fk_packages_hash_artifacts")
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_packages")),
    )
    op.create_index(
        "uq_packages_season_owner_hash", "packages", ["season", "owner", "hash"], unique=True
    )
    op.create_index(
        "ix_packages_unchecked",
        "packages",
        ["created_at"],
        postgresql_where=sa.text("state IN ('received', 'checking')"),
    )
    op.create_index("ix_packages_season_created_at", "packages", ["season", "created_at"])
    op.create_table(
        "package_changes",
        sa.Column("id", sa.BigInteger(), sa.Identity(always=True), nullable=False),
        sa.Column("package", sa.Text(), nullable=False),
        sa.Column("changed_by", sa.Text(), server_default=sa.text("''"), nullable=False),
        sa.Column("state_before", sa.Text(), nullable=False),
        sa.Column("state", sa.Text(), nullable=False),
        sa.Column("reason", sa.Text(), nullable=False),
        _time("at", now=True),
        sa.ForeignKeyConstraint(
            ["package"], ["packages.id"], name=op.f("fk_package_changes_package_packages")
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_package_changes")),
    )
    op.create_index("ix_package_changes_package", "package_changes", ["package"])


def downgrade() -> None:
    op.drop_table("package_changes")
    op.drop_table("packages")
