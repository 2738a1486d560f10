"""words: indexes by which transcripts are searched for words."""

import sqlalchemy as sa
from alembic import op

revision = "2026_11_26_words"
down_revision = "2026_11_26_packages"
branch_labels = None
depends_on = None

LONGEST = 100_000
REPLIES = f"to_tsvector('english', left(reply ->> 'text', {LONGEST}))"
ANSWERS = f"to_tsvector('english', left(feedback, {LONGEST}))"
FEEDBACK = (
    f"(CASE WHEN length(data::text) < {LONGEST} THEN "
    "to_tsvector('english', jsonb_path_query_array(data, '$.results[*][2]')) END)"
)
INDEXES = (
    ("ix_journal_words", "journal", REPLIES, None),
    ("ix_external_calls_words", "external_calls", ANSWERS, None),
    ("ix_events_words", "events", FEEDBACK, "kind = 'turn'"),
)


def upgrade() -> None:
    with op.get_context().autocommit_block():
        for name, table, words, which in INDEXES:
            op.create_index(
                name,
                table,
                [sa.text(words)],
                postgresql_using="gin",
                postgresql_where=None if which is None else sa.text(which),
                postgresql_concurrently=True,
                if_not_exists=True,
            )


def downgrade() -> None:
    with op.get_context().autocommit_block():
        for name, table, _, _ in INDEXES:
            op.drop_index(name, table, postgresql_concurrently=True, if_exists=True)
