"""told: journals keep what sessions told their roles, with an index of its words."""

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects.postgresql import JSON

revision = "2026_11_26_told"
down_revision = "2026_11_26_words"
branch_labels = None
depends_on = None

LONGEST = 100_000
WORDS = f"(CASE WHEN length(told::text) < {LONGEST} THEN to_tsvector('english', told) END)"


def upgrade() -> None:
    op.add_column("journal", sa.Column("told", JSON(none_as_null=True)))
    with op.get_context().autocommit_block():
        op.create_index(
            "ix_journal_told",
            "journal",
            [sa.text(WORDS)],
            postgresql_using="gin",
            postgresql_where=sa.text("told IS NOT NULL"),
            postgresql_concurrently=True,
            if_not_exists=True,
        )


def downgrade() -> None:
    with op.get_context().autocommit_block():
        op.drop_index("ix_journal_told", "journal", postgresql_concurrently=True, if_exists=True)
    op.drop_column("journal", "told")
