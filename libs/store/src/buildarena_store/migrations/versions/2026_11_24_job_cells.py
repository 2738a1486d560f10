"""job cells: an index by which the jobs of a board's cell are found."""

import sqlalchemy as sa
from alembic import op

revision = "2026_11_24_job_cells"
down_revision = "2026_11_24_board_details"
branch_labels = None
depends_on = None

COLUMNS = ["track", "task", "model_hash", "model"]


def upgrade() -> None:
    _replace("ix_jobs_board", "ix_jobs_cell", COLUMNS)


def downgrade() -> None:
    _replace("ix_jobs_cell", "ix_jobs_board", ["track", "task", "model"])


def _replace(old: str, new: str, columns: list[str]) -> None:
    """Makes an index while others write, then drops another."""
    with op.get_context().autocommit_block():
        op.execute(sa.text(f"DROP INDEX CONCURRENTLY IF EXISTS {new}"))
        op.create_index(new, "jobs", columns, postgresql_concurrently=True)
        op.drop_index(old, "jobs", postgresql_concurrently=True, if_exists=True)
