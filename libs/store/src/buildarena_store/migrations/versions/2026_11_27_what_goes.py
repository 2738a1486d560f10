"""what goes: the tables and columns of features that were removed."""

from alembic import op

revision = "2026_11_27_what_goes"
down_revision = "2026_11_27_summaries"
branch_labels = None
depends_on = None
BREAKING = True

TABLES = ("package_changes", "packages", "evidence")
COLUMNS = (("jobs", "imported_from"),)


def upgrade() -> None:
    for name in TABLES:
        op.drop_table(name)
    for table, column in COLUMNS:
        op.drop_column(table, column)


def downgrade() -> None:
    raise NotImplementedError("what was dropped is not made again: restore a backup")
