"""leaderboard changes: a log that triggers write, and that caches follow."""

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects import postgresql

revision = "2026_11_21_leaderboard_changes"
down_revision = "2026_11_21_first_tables"
branch_labels = None
depends_on = None

LOG = """
CREATE FUNCTION log_board_change() RETURNS trigger LANGUAGE plpgsql AS $$
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
        was := OLD.outcome = ANY (scored);
        old_score := jsonb_build_object('outcome', OLD.outcome, 'reason', OLD.reason,
            'success', OLD.success, 'indicator', OLD.indicator, 'flags', OLD.flags);
        job := OLD;
    END IF;
    IF TG_OP <> 'DELETE' AND NEW.state = 'done' THEN
        is_now := NEW.outcome = ANY (scored);
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
    INSERT INTO board_changes (transaction, job_id, track, task, model, kind, before, after, why)
    VALUES (pg_current_xact_id()::text::bigint, job.id, job.track, job.task, job.model, kind,
            old_score, new_score, NULLIF(current_setting('buildarena.why', true), ''));
    RETURN NULL;
END $$
"""
# The columns that a board shows; leases and nudges of jobs that go on write nothing here.
TRIGGERS = (
    """CREATE TRIGGER log_board_insert AFTER INSERT ON jobs FOR EACH ROW
    WHEN (NEW.state = 'done') EXECUTE FUNCTION log_board_change()""",
    """CREATE TRIGGER log_board_delete AFTER DELETE ON jobs FOR EACH ROW
    WHEN (OLD.state = 'done') EXECUTE FUNCTION log_board_change()""",
    """CREATE TRIGGER log_board_update AFTER UPDATE ON jobs FOR EACH ROW
    WHEN ((OLD.state = 'done' OR NEW.state = 'done') AND
    (OLD.state, OLD.outcome, OLD.reason, OLD.success, OLD.indicator, OLD.metrics, OLD.flags,
     OLD.refusals, OLD.requests, OLD.input_tokens, OLD.output_tokens, OLD.cost_usd, OLD.actions,
     OLD.refused_actions, OLD.finished_at) IS DISTINCT FROM
    (NEW.state, NEW.outcome, NEW.reason, NEW.success, NEW.indicator, NEW.metrics, NEW.flags,
     NEW.refusals, NEW.requests, NEW.input_tokens, NEW.output_tokens, NEW.cost_usd, NEW.actions,
     NEW.refused_actions, NEW.finished_at)) EXECUTE FUNCTION log_board_change()""",
)
# What had ended before the log was there enters with it.
BACKFILL = """
INSERT INTO board_changes (transaction, job_id, track, task, model, kind, after, why, at)
SELECT pg_current_xact_id()::text::bigint, id, track, task, model,
    CASE WHEN outcome IN ('success', 'unsuccessful', 'construction_failed', 'limit')
        THEN 'entered' ELSE 'unscored' END,
    jsonb_build_object('outcome', outcome, 'reason', reason, 'success', success,
        'indicator', indicator, 'flags', flags),
    'ended before changes were logged', COALESCE(finished_at, clock_timestamp())
FROM jobs WHERE state = 'done' ORDER BY finished_at, id
"""


def upgrade() -> None:
    op.create_table(
        "board_changes",
        sa.Column("id", sa.BigInteger(), sa.Identity(always=False), nullable=False),
        sa.Column("transaction", sa.BigInteger(), nullable=False),
        sa.Column("job_id", sa.Text(), nullable=False),
        sa.Column("track", sa.Text(), nullable=False),
        sa.Column("task", sa.Text(), nullable=False),
        sa.Column("model", sa.Text(), nullable=False),
        sa.Column("kind", sa.Text(), nullable=False),
        sa.Column("before", postgresql.JSONB(astext_type=sa.Text()), nullable=True),
        sa.Column("after", postgresql.JSONB(astext_type=sa.Text()), nullable=True),
        sa.Column("why", sa.Text(), nullable=True),
        sa.Column(
            "at",
            sa.DateTime(timezone=True),
            server_default=sa.text("clock_timestamp()"),
            nullable=False,
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_board_changes")),
    )
    op.create_index("ix_board_changes_transaction", "board_changes", ["transaction"])
    op.create_index("ix_board_changes_track", "board_changes", ["track", "id"])
    op.execute(BACKFILL)
    op.execute(LOG)
    for trigger in TRIGGERS:
        op.execute(trigger)


def downgrade() -> None:
    for name in ("insert", "delete", "update"):
        op.execute(f"DROP TRIGGER log_board_{name} ON jobs")
    op.execute("DROP FUNCTION log_board_change()")
    op.drop_table("board_changes")
