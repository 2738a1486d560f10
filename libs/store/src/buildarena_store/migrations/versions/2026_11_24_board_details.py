"""board details: what a cell's totals are made of, so that boards of a period read no jobs."""

import sqlalchemy as sa
from alembic import op

revision = "2026_11_24_board_details"
down_revision = "2026_11_24_traces"
branch_labels = None
depends_on = None


def upgrade() -> None:
    column = sa.Column("details", sa.LargeBinary(), nullable=False, server_default=sa.text("''"))
    op.add_column("board_cells", column)


def downgrade() -> None:
    op.drop_column("board_cells", "details")
