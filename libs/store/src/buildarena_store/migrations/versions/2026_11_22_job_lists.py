"""job lists: indexes for every order and filter, and counts that are kept instead of counted."""

# ruff: noqa: S608 - statements are made of constants of this file

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects import postgresql

revision = "2026_11_22_job_lists"
down_revision = "2026_11_22_board_cells"
branch_labels = None
depends_on = None

COST = "(CASE WHEN model_config->>'provider' = 'external' THEN NULL::numeric ELSE cost_usd END)"
INDEXES = (
    "ix_jobs_created ON jobs (created_at, id)",
    "ix_jobs_finished ON jobs (finished_at, id)",
    "ix_jobs_indicator ON jobs (indicator, id)",
    f"ix_jobs_ended_cost ON jobs ({COST}, id) WHERE state = 'done'",
    f"ix_jobs_open_cost ON jobs ({COST}, id) WHERE state <> 'done'",
    "ix_jobs_task ON jobs (task, id)",
    "ix_jobs_model ON jobs (model, id)",
    "ix_jobs_seed ON jobs (seed, id)",
    "ix_jobs_outcome ON jobs (outcome, id) WHERE outcome IS NOT NULL",
    "ix_jobs_reason ON jobs (reason, id) WHERE reason IS NOT NULL",
    "ix_jobs_detail ON jobs (id) WHERE detail IS NOT NULL",
    "ix_jobs_flags ON jobs USING gin (flags jsonb_path_ops) WHERE flags IS NOT NULL",
    "ix_jobs_oldest ON jobs (queue, created_at, id) WHERE state = 'queued'",
    "ix_jobs_available ON jobs (queue, available_at) WHERE state = 'queued'",
)
# Rows of these change again and again, so they are swept before a fifth of them is dead.
BUSY = ("jobs", "attempts", "journal", "figure_changes", "board_cells")
BOUNDS = "0.05, 0.1, 0.25, 0.5, 1, 2.5, 5, 10, 30, 60, 120, 300, 600, 1800, 3600"
FUNCTIONS = f"""
CREATE FUNCTION job_place(job jobs) RETURNS jsonb LANGUAGE sql IMMUTABLE AS $$
    SELECT jsonb_build_array(job.state, job.stage, COALESCE(job.outcome, ''),
        CASE WHEN job.outcome = 'errored' THEN COALESCE(job.reason, '') ELSE '' END,
        CASE WHEN job.state = 'queued' THEN job.queue ELSE '' END)
$$;
CREATE FUNCTION count_jobs_added() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    INSERT INTO figure_changes (kind, key, a, b, c, d)
    SELECT 'jobs', job_place(added), count(*), 0, 0, 0 FROM added GROUP BY 2;
    INSERT INTO figure_changes (kind, key, a, b, c, d)
    SELECT 'models', jsonb_build_array(model), sum(requests), sum(input_tokens),
        sum(output_tokens), sum(cost_usd) FROM added GROUP BY 2;
    RETURN NULL;
END $$;
CREATE FUNCTION count_jobs_removed() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    INSERT INTO figure_changes (kind, key, a, b, c, d)
    SELECT 'jobs', job_place(removed), -count(*), 0, 0, 0 FROM removed GROUP BY 2;
    INSERT INTO figure_changes (kind, key, a, b, c, d)
    SELECT 'models', jsonb_build_array(model), -sum(requests), -sum(input_tokens),
        -sum(output_tokens), -sum(cost_usd) FROM removed GROUP BY 2;
    RETURN NULL;
END $$;
CREATE FUNCTION count_job_moved() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    INSERT INTO figure_changes (kind, key, a, b, c, d)
    VALUES ('jobs', job_place(OLD), -1, 0, 0, 0), ('jobs', job_place(NEW), 1, 0, 0, 0);
    RETURN NULL;
END $$;
CREATE FUNCTION count_job_use() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    INSERT INTO figure_changes (kind, key, a, b, c, d)
    VALUES ('models', jsonb_build_array(NEW.model), NEW.requests - OLD.requests,
        NEW.input_tokens - OLD.input_tokens, NEW.output_tokens - OLD.output_tokens,
        NEW.cost_usd - OLD.cost_usd);
    RETURN NULL;
END $$;
CREATE FUNCTION attempt_class(seconds double precision) RETURNS int LANGUAGE sql IMMUTABLE AS $$
    SELECT width_bucket(seconds, ARRAY[{BOUNDS}]::double precision[])
$$;
CREATE FUNCTION count_attempt_ended() RETURNS trigger LANGUAGE plpgsql AS $$
DECLARE
    seconds CONSTANT double precision := extract(epoch FROM NEW.ended_at - NEW.started_at);
BEGIN
    INSERT INTO figure_changes (kind, key, a, b, c, d)
    VALUES ('stages', jsonb_build_array(NEW.stage, NEW.result, attempt_class(seconds)),
        1, seconds, 0, 0);
    RETURN NULL;
END $$;
CREATE FUNCTION recount_jobs() RETURNS void LANGUAGE sql AS $$
    DELETE FROM figure_changes;
    DELETE FROM figures;
    INSERT INTO figures SELECT 'jobs', job_place(jobs), count(*), 0, 0, 0 FROM jobs GROUP BY 2;
    INSERT INTO figures SELECT 'models', jsonb_build_array(model), sum(requests),
        sum(input_tokens), sum(output_tokens), sum(cost_usd) FROM jobs GROUP BY 2;
    INSERT INTO figures SELECT 'stages', jsonb_build_array(stage, result, attempt_class(seconds)),
        count(*), sum(seconds), 0, 0
    FROM (SELECT stage, result, extract(epoch FROM ended_at - started_at)::double precision
        AS seconds FROM attempts WHERE ended_at IS NOT NULL) AS took GROUP BY 2;
$$;
"""
PLACE = "state, stage, outcome, reason, queue"
USE = "requests, input_tokens, output_tokens, cost_usd"


def upgrade() -> None:
    op.drop_index("ix_jobs_newest", "jobs")
    for index in INDEXES:
        op.execute(f"CREATE INDEX {index}")
    amounts = [sa.Column(name, sa.Numeric(), nullable=False) for name in "abcd"]
    op.create_table(
        "figures",
        sa.Column("kind", sa.Text(), nullable=False),
        sa.Column("key", postgresql.JSONB(), nullable=False),
        *amounts,
        sa.PrimaryKeyConstraint("kind", "key", name=op.f("pk_figures")),
    )
    op.create_table(
        "figure_changes",
        sa.Column("kind", sa.Text(), nullable=False),
        sa.Column("key", postgresql.JSONB(), nullable=False),
        *[sa.Column(name, sa.Numeric(), nullable=False) for name in "abcd"],
    )
    op.execute(FUNCTIONS)
    op.execute("SELECT recount_jobs()")
    for trigger in _triggers():
        op.execute(trigger)
    for table in BUSY:
        op.execute(
            f"ALTER TABLE {table} SET (autovacuum_vacuum_scale_factor = 0.02, "
            "autovacuum_vacuum_insert_scale_factor = 0.05, autovacuum_analyze_scale_factor = 0.02)"
        )
    # Room on each page, so that a reply's cost is written beside the row and not elsewhere.
    op.execute("ALTER TABLE jobs SET (fillfactor = 90)")


def downgrade() -> None:
    op.execute(
        "ALTER TABLE jobs RESET (fillfactor, autovacuum_vacuum_scale_factor, "
        "autovacuum_vacuum_insert_scale_factor, autovacuum_analyze_scale_factor)"
    )
    for table in ("attempts", "journal", "board_cells"):
        op.execute(
            f"ALTER TABLE {table} RESET (autovacuum_vacuum_scale_factor, "
            "autovacuum_vacuum_insert_scale_factor, autovacuum_analyze_scale_factor)"
        )
    for name in ("added", "removed", "moved", "used"):
        op.execute(f"DROP TRIGGER count_jobs_{name} ON jobs")
    for name in ("added", "ended"):
        op.execute(f"DROP TRIGGER count_attempts_{name} ON attempts")
    for name in (
        "recount_jobs()",
        "count_attempt_ended()",
        "attempt_class(double precision)",
        "count_job_use()",
        "count_job_moved()",
        "count_jobs_removed()",
        "count_jobs_added()",
        "job_place(jobs)",
    ):
        op.execute(f"DROP FUNCTION {name}")
    op.drop_table("figure_changes")
    op.drop_table("figures")
    for index in INDEXES:
        op.drop_index(index.split()[0], "jobs")
    op.create_index("ix_jobs_newest", "jobs", [sa.text("created_at DESC"), "id"])


def _triggers() -> list[str]:
    return [
        (
            "CREATE TRIGGER count_jobs_added AFTER INSERT ON jobs REFERENCING NEW TABLE AS added "
            "FOR EACH STATEMENT EXECUTE FUNCTION count_jobs_added()"
        ),
        (
            "CREATE TRIGGER count_jobs_removed AFTER DELETE ON jobs "
            "REFERENCING OLD TABLE AS removed "
            "FOR EACH STATEMENT EXECUTE FUNCTION count_jobs_removed()"
        ),
        (
            "CREATE TRIGGER count_jobs_moved AFTER UPDATE ON jobs FOR EACH ROW "
            f"WHEN ({_differ(PLACE)}) EXECUTE FUNCTION count_job_moved()"
        ),
        (
            "CREATE TRIGGER count_jobs_used AFTER UPDATE ON jobs FOR EACH ROW "
            f"WHEN ({_differ(USE)}) EXECUTE FUNCTION count_job_use()"
        ),
        (
            "CREATE TRIGGER count_attempts_added AFTER INSERT ON attempts FOR EACH ROW "
            "WHEN (NEW.ended_at IS NOT NULL) EXECUTE FUNCTION count_attempt_ended()"
        ),
        (
            "CREATE TRIGGER count_attempts_ended AFTER UPDATE ON attempts FOR EACH ROW "
            "WHEN (OLD.ended_at IS NULL AND NEW.ended_at IS NOT NULL) "
            "EXECUTE FUNCTION count_attempt_ended()"
        ),
    ]


def _differ(columns: str) -> str:
    old, new = (
        ", ".join(f"{row}.{name.strip()}" for name in columns.split(",")) for row in ("OLD", "NEW")
    )
    return f"({old}) IS DISTINCT FROM ({new})"
