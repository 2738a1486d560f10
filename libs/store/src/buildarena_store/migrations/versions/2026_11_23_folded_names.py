"""folded names: those that people may take for each other are found together."""

import sqlalchemy as sa
from alembic import op

revision = "2026_11_23_folded_names"
down_revision = "2026_11_22_job_lists"
branch_labels = None
depends_on = None

FOLD = (
    "replace(replace(translate(lower(regexp_replace(name, '[._-]', '', 'g')), '01i5', 'olls'),"
    " 'rn', 'm'), 'vv', 'w')"
)


def upgrade() -> None:
    op.add_column("names", sa.Column("folded", sa.Text(), sa.Computed(FOLD, persisted=True)))
    op.create_index("ix_names_folded", "names", ["folded"])


def downgrade() -> None:
    op.drop_index("ix_names_folded", "names")
    op.drop_column("names", "folded")
