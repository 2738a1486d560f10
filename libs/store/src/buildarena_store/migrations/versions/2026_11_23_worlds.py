"""worlds: trials of finished machines in varied worlds, which have a seed."""

import sqlalchemy as sa
from alembic import op

revision = "2026_11_23_worlds"
down_revision = "2026_11_23_audits"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("rollouts", sa.Column("seed", sa.BigInteger()))


def downgrade() -> None:
    op.drop_column("rollouts", "seed")
