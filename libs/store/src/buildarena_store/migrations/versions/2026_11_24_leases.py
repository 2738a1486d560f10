"""leases: when a lease ends stands in a narrow table of its own."""

import sqlalchemy as sa
from alembic import op

revision = "2026_11_24_leases"
down_revision = "2026_11_23_worlds"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "leases",
        sa.Column("job_id", sa.Text(), nullable=False),
        sa.Column("token", sa.BigInteger(), nullable=False),
        sa.Column(
            "expires_at",
            sa.DateTime(timezone=True),
            server_default=sa.text("clock_timestamp()"),
            nullable=False,
        ),
        sa.PrimaryKeyConstraint("job_id", name=op.f("pk_leases")),
    )
    # Room in each page for ten versions of its rows; pages that are looked at clean themselves.
    op.execute("ALTER TABLE leases SET (fillfactor = 10)")


def downgrade() -> None:
    op.drop_table("leases")
