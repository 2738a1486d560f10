"""The tables of 1.0.0, in sql/0001_tables.sql, and their triggers, in sql/triggers.sql.

Its name has the fingerprint of what it makes, which a test compares: a database of another release
candidate is refused. From 1.0.0 on neither file changes; later revisions add to them.
"""

from alembic import op

from buildarena_backend.database.migrations import TRIGGERS

revision = "0001_cf3923d3"
down_revision = None
branch_labels = None
depends_on = None
BREAKING = True


def upgrade() -> None:
    for file in (TRIGGERS.with_name("0001_tables.sql"), TRIGGERS):
        # Past SQLAlchemy, to which percent signs would be parameters.
        op.get_bind().connection.cursor().execute(file.read_text(encoding="utf-8"))


def downgrade() -> None:
    raise NotImplementedError("there is nothing before it: drop the database")
