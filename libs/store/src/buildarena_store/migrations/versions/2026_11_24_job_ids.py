"""job ids: what makes a job unique is in its id already, and one index less is written for each."""

from alembic import op

revision = "2026_11_24_job_ids"
down_revision = "2026_11_24_job_cells"
branch_labels = None
depends_on = None

KEY = ["task", "task_version", "model_hash", "track", "seed"]
UNIQUE = "uq_jobs_" + "_".join(KEY)


def upgrade() -> None:
    op.drop_constraint(UNIQUE, "jobs")


def downgrade() -> None:
    op.create_unique_constraint(UNIQUE, "jobs", KEY)
