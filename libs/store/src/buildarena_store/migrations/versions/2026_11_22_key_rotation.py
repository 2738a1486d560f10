"""key rotation: the secret before, which stays good for a while."""

import sqlalchemy as sa
from alembic import op

revision = "2026_11_22_key_rotation"
down_revision = "2026_11_22_annotations"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("api_keys", sa.Column("previous_hash", sa.Text()))
    op.add_column("api_keys", sa.Column("previous_until", sa.DateTime(timezone=True)))
    op.create_unique_constraint(op.f("uq_api_keys_previous_hash"), "api_keys", ["previous_hash"])


def downgrade() -> None:
    op.drop_constraint(op.f("uq_api_keys_previous_hash"), "api_keys", type_="unique")
    op.drop_column("api_keys", "previous_until")
    op.drop_column("api_keys", "previous_hash")
