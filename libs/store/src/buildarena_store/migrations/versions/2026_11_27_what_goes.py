"""what goes: tables of features that nobody uses."""

from alembic import op

revision = "2026_11_27_what_goes"
down_revision = "2026_11_27_summaries"
branch_labels = None
depends_on = None

BREAKING = True
TABLES = ("evidence",)
"""In the order in which they can be dropped."""


def upgrade() -> None:
    for table in TABLES:
        op.drop_table(table)
