"""keys, budgets, tasks: who may do what and spend how much, and tasks of users' own."""

from typing import Any

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects import postgresql

revision = "2026_11_21_keys_budgets_tasks"
down_revision = "2026_11_21_leaderboard_changes"
branch_labels = None
depends_on = None

NOT_DONE = sa.text("state != 'done'")


def _time(name: str, *, now: bool = False) -> sa.Column[object]:
    default = sa.text("clock_timestamp()") if now else None
    return sa.Column(name, sa.DateTime(timezone=True), nullable=not now, server_default=default)


def _spent(name: str, kind: sa.types.TypeEngine[Any]) -> sa.Column[object]:
    return sa.Column(name, kind, nullable=False, server_default=sa.text("0"))


def upgrade() -> None:
    op.add_column("jobs", sa.Column("owner", sa.Text(), nullable=True))
    op.add_column("jobs", sa.Column("payer", sa.Text(), nullable=True))
    op.create_index("ix_jobs_payer", "jobs", ["payer"], postgresql_where=NOT_DONE)
    op.create_index("ix_jobs_owner", "jobs", ["owner"], postgresql_where=NOT_DONE)
    op.add_column("workers", sa.Column("clock_ahead_s", sa.Double(), nullable=True))
    op.add_column("sweeps", sa.Column("jobs_hash", sa.Text(), nullable=True))
    op.create_index(op.f("ix_sweeps_jobs_hash"), "sweeps", ["jobs_hash"])
    op.create_table(
        "tasks",
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("version", sa.Text(), nullable=False),
        sa.Column("document", sa.Text(), nullable=False),
        sa.Column("owner", sa.Text(), nullable=True),
        _time("created_at", now=True),
        sa.PrimaryKeyConstraint("name", "version", name=op.f("pk_tasks")),
    )
    op.create_table(
        "api_keys",
        sa.Column("id", sa.Text(), nullable=False),
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("secret_hash", sa.Text(), nullable=False),
        sa.Column("scopes", postgresql.JSONB(astext_type=sa.Text()), nullable=False),
        _time("created_at", now=True),
        _time("expires_at"),
        _time("revoked_at"),
        _time("used_at"),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_api_keys")),
        sa.UniqueConstraint("secret_hash", name=op.f("uq_api_keys_secret_hash")),
    )
    op.create_table(
        "budgets",
        sa.Column("id", sa.Text(), nullable=False),
        sa.Column("max_cost_usd", sa.Numeric(14, 6), nullable=True),
        sa.Column("max_tokens", sa.BigInteger(), nullable=True),
        sa.Column("max_requests", sa.BigInteger(), nullable=True),
        _spent("spent_cost_usd", sa.Numeric(14, 6)),
        _spent("spent_tokens", sa.BigInteger()),
        _spent("spent_requests", sa.BigInteger()),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_budgets")),
    )
    op.create_table(
        "reservations",
        sa.Column("job_id", sa.Text(), nullable=False),
        sa.Column("budget_id", sa.Text(), nullable=False),
        sa.Column("token", sa.BigInteger(), nullable=False),
        sa.Column("cost_usd", sa.Numeric(14, 6), nullable=False),
        sa.Column("tokens", sa.BigInteger(), nullable=False),
        sa.ForeignKeyConstraint(["job_id"], ["jobs.id"], name=op.f("fk_reservations_job_id_jobs")),
        sa.ForeignKeyConstraint(
            ["budget_id"],
            ["budgets.id"],
            name=op.f("fk_reservations_budget_id_budgets"),
            ondelete="CASCADE",
        ),
        sa.PrimaryKeyConstraint("job_id", "budget_id", name=op.f("pk_reservations")),
    )
    op.create_index("ix_reservations_budget", "reservations", ["budget_id"])


def downgrade() -> None:
    for table in ("reservations", "budgets", "api_keys", "tasks"):
        op.drop_table(table)
    op.drop_index("ix_jobs_owner", "jobs")
    op.drop_index("ix_jobs_payer", "jobs")
    op.drop_index(op.f("ix_sweeps_jobs_hash"), "sweeps")
    op.drop_column("sweeps", "jobs_hash")
    op.drop_column("workers", "clock_ahead_s")
    op.drop_column("jobs", "payer")
    op.drop_column("jobs", "owner")
