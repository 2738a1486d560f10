"""All tables of `buildarena_backend.database.tables`, and the triggers of sql/triggers.sql.

Until 1.0.0 there is this revision alone. Its name has the fingerprint of what it makes, which a
test compares: a database of another release candidate is refused. From 1.0.0 on the chain grows.
"""

from alembic import op

from buildarena_backend.database.migrations import TRIGGERS
from buildarena_backend.database.tables import metadata

revision = "0001_75d36e9f"
down_revision = None
branch_labels = None
depends_on = None
BREAKING = True


def upgrade() -> None:
    metadata.create_all(op.get_bind(), checkfirst=False)
    # Past SQLAlchemy, to which its percent signs would be parameters.
    op.get_bind().connection.cursor().execute(TRIGGERS.read_text(encoding="utf-8"))


def downgrade() -> None:
    raise NotImplementedError("there is nothing before it: drop the database")
