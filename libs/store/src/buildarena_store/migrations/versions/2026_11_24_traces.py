"""traces: the span of a job's submission, which all that is done for it is a part of."""

import sqlalchemy as sa
from alembic import op

revision = "2026_11_24_traces"
down_revision = "2026_11_24_draws"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("jobs", sa.Column("traceparent", sa.Text()))


def downgrade() -> None:
    op.drop_column("jobs", "traceparent")
