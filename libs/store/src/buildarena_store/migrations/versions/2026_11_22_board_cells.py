"""board cells: leaderboards keep tallies of cells, and the change log names the cell."""

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects import postgresql

revision = "2026_11_22_board_cells"
down_revision = "2026_11_22_runner_keys"
branch_labels = None
depends_on = None

CELL = "task_version, configuration, "
# Files that were tried are in no ranking, so they change no cell.
VALUES = """job.task_version,
            CASE WHEN job.model_config->>'provider' = 'file' THEN NULL ELSE job.model_hash END,"""
LOG = """
CREATE OR REPLACE FUNCTION log_board_change() RETURNS trigger LANGUAGE plpgsql AS $$
DECLARE
    scored CONSTANT text[] := ARRAY['success', 'unsuccessful', 'construction_failed', 'limit'];
    old_score jsonb;
    new_score jsonb;
    job jobs%ROWTYPE;
    was boolean := false;
    is_now boolean := false;
    kind text;
BEGIN
    IF TG_OP <> 'INSERT' AND OLD.state = 'done' THEN
        was := OLD.outcome = ANY (scored)
            AND (OLD.imported_from IS NULL OR OLD.verified_at IS NOT NULL);
        old_score := jsonb_build_object('outcome', OLD.outcome, 'reason', OLD.reason,
            'success', OLD.success, 'indicator', OLD.indicator, 'flags', OLD.flags);
        job := OLD;
    END IF;
    IF TG_OP <> 'DELETE' AND NEW.state = 'done' THEN
        is_now := NEW.outcome = ANY (scored)
            AND (NEW.imported_from IS NULL OR NEW.verified_at IS NOT NULL);
        new_score := jsonb_build_object('outcome', NEW.outcome, 'reason', NEW.reason,
            'success', NEW.success, 'indicator', NEW.indicator, 'flags', NEW.flags);
        job := NEW;
    END IF;
    kind := CASE
        WHEN is_now AND NOT was THEN 'entered'
        WHEN was AND NOT is_now THEN 'left'
        WHEN was AND is_now AND old_score IS DISTINCT FROM new_score THEN 'rescored'
        WHEN was AND is_now THEN 'corrected'
        ELSE 'unscored' END;
    INSERT INTO board_changes
        (transaction, job_id, track, task, {columns}model, kind, before, after, why)
    VALUES (pg_current_xact_id()::text::bigint, job.id, job.track, job.task, {values}
            job.model, kind, old_score, new_score,
            NULLIF(current_setting('buildarena.why', true), ''));
    RETURN NULL;
END $$
"""


def upgrade() -> None:
    op.add_column("board_changes", sa.Column("task_version", sa.Text()))
    op.add_column("board_changes", sa.Column("configuration", sa.Text()))
    op.create_table(
        "board_cells",
        sa.Column("format", sa.Integer(), nullable=False),
        sa.Column("track", sa.Text(), nullable=False),
        sa.Column("task", sa.Text(), nullable=False),
        sa.Column("task_version", sa.Text(), nullable=False),
        sa.Column("configuration", sa.Text(), nullable=False),
        sa.Column("model", sa.Text(), nullable=False),
        sa.Column("decoding", sa.JSON(), nullable=False),
        sa.Column("jobs", sa.BigInteger(), nullable=False),
        sa.Column("newest", sa.DateTime(timezone=True)),
        sa.Column("tallies", sa.JSON(), nullable=False),
        sa.Column("figures", postgresql.BYTEA(), nullable=False),
        sa.Column("snapshot", sa.Text(), nullable=False),
        sa.Column("snapshot_end", sa.BigInteger(), nullable=False),
        sa.Column("snapshot_open", sa.Integer(), nullable=False),
        sa.PrimaryKeyConstraint(
            "format",
            "track",
            "task",
            "task_version",
            "configuration",
            name=op.f("pk_board_cells"),
        ),
    )
    # Floats do not compress; trying costs more than it saves.
    op.execute("ALTER TABLE board_cells ALTER COLUMN figures SET STORAGE EXTERNAL")
    op.create_table(
        "board_state",
        sa.Column("format", sa.Integer(), nullable=False),
        sa.Column("server", sa.Text(), nullable=False),
        sa.Column("snapshot", sa.Text(), nullable=False),
        sa.Column("snapshot_end", sa.BigInteger(), nullable=False),
        sa.Column("snapshot_open", sa.Integer(), nullable=False),
        sa.PrimaryKeyConstraint("format", name=op.f("pk_board_state")),
    )
    op.execute(_log(columns=CELL, values=VALUES))


def downgrade() -> None:
    op.execute(_log(columns="", values=""))
    op.drop_table("board_state")
    op.drop_table("board_cells")
    op.drop_column("board_changes", "configuration")
    op.drop_column("board_changes", "task_version")


def _log(*, columns: str, values: str) -> str:
    return LOG.replace("{columns}", columns).replace("{values}", values)
