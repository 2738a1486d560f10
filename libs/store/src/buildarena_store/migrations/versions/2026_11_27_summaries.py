"""summaries: cells are kept with their summaries, so that a process that starts makes none."""

import sqlalchemy as sa
from alembic import op

revision = "2026_11_27_summaries"
down_revision = "2026_11_26_members"
branch_labels = None
depends_on = None

FIGURES = ("details", "samples")


def upgrade() -> None:
    op.add_column("board_cells", sa.Column("summaries", sa.JSON()))
    samples = sa.Column("samples", sa.LargeBinary(), nullable=False, server_default=sa.text("''"))
    op.add_column("board_cells", samples)
    op.add_column("board_cells", sa.Column("summarised", sa.Text()))
    # Figures hardly shrink, and trying takes longer than writing them.
    for name in FIGURES:
        op.execute(f"ALTER TABLE board_cells ALTER COLUMN {name} SET STORAGE EXTERNAL")


def downgrade() -> None:
    op.execute("ALTER TABLE board_cells ALTER COLUMN details SET STORAGE EXTENDED")
    for name in ("summaries", "samples", "summarised"):
        op.drop_column("board_cells", name)
