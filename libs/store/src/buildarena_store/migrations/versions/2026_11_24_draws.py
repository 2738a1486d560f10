"""draws: what draws the numbers that a job's builder is not told."""

import sqlalchemy as sa
from alembic import op

revision = "2026_11_24_draws"
down_revision = "2026_11_24_leases"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("jobs", sa.Column("draw", sa.BigInteger()))


def downgrade() -> None:
    op.drop_column("jobs", "draw")
