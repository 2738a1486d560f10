"""evidence: files of evenings with the game, and what they show."""

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects.postgresql import JSONB

revision = "2026_11_25_evidence"
down_revision = "2026_11_24_sweep_figures"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "evidence",
        sa.Column("hash", sa.Text(), nullable=False),
        sa.Column("made_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("judged", JSONB(), nullable=False),
        sa.Column("owner", sa.Text()),
        sa.Column(
            "created_at",
            sa.DateTime(timezone=True),
            server_default=sa.text("clock_timestamp()"),
            nullable=False,
        ),
        sa.ForeignKeyConstraint(
            ["hash"], ["artifacts.hash"], name=op.f("fk_evidence_hash_artifacts")
        ),
        sa.PrimaryKeyConstraint("hash", name=op.f("pk_evidence")),
    )


def downgrade() -> None:
    op.drop_table("evidence")
