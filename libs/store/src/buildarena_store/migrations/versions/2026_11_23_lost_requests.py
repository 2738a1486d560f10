"""lost requests: replies that may have been paid for and that no journal has."""

from typing import Any

import sqlalchemy as sa
from alembic import op

revision = "2026_11_23_lost_requests"
down_revision = "2026_11_23_folded_names"
branch_labels = None
depends_on = None


def upgrade() -> None:
    for table in ("jobs", "budgets"):
        op.add_column(table, _count("lost_requests", sa.BigInteger()))
    op.add_column("budgets", _count("lost_cost_usd", sa.Numeric(14, 6)))


def downgrade() -> None:
    op.drop_column("budgets", "lost_cost_usd")
    for table in ("budgets", "jobs"):
        op.drop_column(table, "lost_requests")


def _count(name: str, kind: Any) -> Any:
    return sa.Column(name, kind, nullable=False, server_default=sa.text("0"))
