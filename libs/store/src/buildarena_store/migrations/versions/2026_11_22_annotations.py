"""annotations: what our engines say of machines that the game tried."""

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects.postgresql import JSONB

revision = "2026_11_22_annotations"
down_revision = "2026_11_22_tenants"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("rollouts", sa.Column("annotations", JSONB()))


def downgrade() -> None:
    op.drop_column("rollouts", "annotations")
