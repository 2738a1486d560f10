"""runner keys: which simulators' jobs a key's runners may lease, and whose."""

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects.postgresql import JSONB

revision = "2026_11_22_runner_keys"
down_revision = "2026_11_22_compatibility"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("api_keys", sa.Column("simulators", JSONB(none_as_null=True)))
    op.add_column("api_keys", sa.Column("job_owners", JSONB(none_as_null=True)))


def downgrade() -> None:
    op.drop_column("api_keys", "job_owners")
    op.drop_column("api_keys", "simulators")
