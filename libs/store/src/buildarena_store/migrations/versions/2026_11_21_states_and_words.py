"""states and words: on_hold, budget_exhausted, notified_at."""

from alembic import op

revision = "2026_11_21_states_and_words"
down_revision = "2026_11_21_keys_budgets_tasks"
branch_labels = None
depends_on = None

# Table, column, old value, new value, and which rows.
# Written into statements as they are: constants of this file.
WORDS = (
    ("jobs", "state", "held", "on_hold", "true"),
    ("sweeps", "state", "limit", "budget_exhausted", "true"),
    ("events", "kind", "held", "on_hold", "job_id IS NOT NULL"),
    ("events", "kind", "limit", "budget_exhausted", "sweep_id IS NOT NULL"),
    ("attempts", "result", "limit", "budget_exhausted", "true"),
)
COLUMNS = (("jobs", "nudged_at", "notified_at"), ("verifications", "nudged_at", "notified_at"))


def upgrade() -> None:
    for table, column, old, new, rows in WORDS:
        op.execute(f"UPDATE {table} SET {column} = '{new}' WHERE {column} = '{old}' AND {rows}")  # noqa: S608
    for table, old_name, new_name in COLUMNS:
        op.alter_column(table, old_name, new_column_name=new_name)


def downgrade() -> None:
    for table, old_name, new_name in COLUMNS:
        op.alter_column(table, new_name, new_column_name=old_name)
    for table, column, old, new, rows in WORDS:
        op.execute(f"UPDATE {table} SET {column} = '{old}' WHERE {column} = '{new}' AND {rows}")  # noqa: S608
