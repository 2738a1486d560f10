"""compatibility: the oldest schema whose programs work with this one."""

import sqlalchemy as sa
from alembic import op

revision = "2026_11_22_compatibility"
down_revision = "2026_11_22_key_rotation"
branch_labels = None
depends_on = None
# Programs of earlier schemas refuse every other one, so nothing is promised to them.
BREAKING = True


def upgrade() -> None:
    op.create_table(
        "schema_compatibility",
        sa.Column("since", sa.Text(), nullable=False),
        sa.PrimaryKeyConstraint("since", name=op.f("pk_schema_compatibility")),
    )


def downgrade() -> None:
    op.drop_table("schema_compatibility")
