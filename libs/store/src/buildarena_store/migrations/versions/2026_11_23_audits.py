"""audits: what a runner or another service brought counts once it was verified, and no longer
once it was refuted."""

import sqlalchemy as sa
from alembic import op

revision = "2026_11_23_audits"
down_revision = "2026_11_23_lost_requests"
branch_labels = None
depends_on = None

COMPARED = (
    "state, outcome, reason, success, indicator, metrics, flags, refusals, requests, "
    "input_tokens, output_tokens, cost_usd, actions, refused_actions, finished_at"
)
IMPORTED = "({row}.imported_from IS NULL OR {row}.verified_at IS NOT NULL)"
AUDITED = "COALESCE({row}.audit, 'verified') = 'verified'"
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
        was := OLD.outcome = ANY (scored) AND {was};
        old_score := jsonb_build_object('outcome', OLD.outcome, 'reason', OLD.reason,
            'success', OLD.success, 'indicator', OLD.indicator, 'flags', OLD.flags);
        job := OLD;
    END IF;
    IF TG_OP <> 'DELETE' AND NEW.state = 'done' THEN
        is_now := NEW.outcome = ANY (scored) AND {is_now};
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
    INSERT INTO board_changes (transaction, job_id, track, task, task_version, configuration,
        model, kind, before, after, why)
    VALUES (pg_current_xact_id()::text::bigint, job.id, job.track, job.task, job.task_version,
            CASE WHEN job.model_config->>'provider' = 'file' THEN NULL ELSE job.model_hash END,
            job.model, kind, old_score, new_score,
            NULLIF(current_setting('buildarena.why', true), ''));
    RETURN NULL;
END $$
"""
COUNT = """
CREATE FUNCTION count_verification_ended() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    INSERT INTO figure_changes (kind, key, a, b, c, d)
    VALUES ('verifications', jsonb_build_array(NEW.verdict), 1, 0, 0, 0);
    RETURN NULL;
END $$;
CREATE TRIGGER count_verifications_ended AFTER UPDATE ON verifications FOR EACH ROW
WHEN (OLD.verdict IS NULL AND NEW.verdict IS NOT NULL)
EXECUTE FUNCTION count_verification_ended();
CREATE FUNCTION count_job_audited() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    INSERT INTO figure_changes (kind, key, a, b, c, d)
    SELECT 'audits', jsonb_build_array(audit), number, 0, 0, 0
    FROM (VALUES (OLD.audit, -1), (NEW.audit, 1)) AS moved (audit, number)
    WHERE audit IS NOT NULL;
    RETURN NULL;
END $$;
CREATE TRIGGER count_jobs_audited AFTER UPDATE ON jobs FOR EACH ROW
WHEN (OLD.audit IS DISTINCT FROM NEW.audit) EXECUTE FUNCTION count_job_audited();
CREATE FUNCTION count_audits_added() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    INSERT INTO figure_changes (kind, key, a, b, c, d)
    SELECT 'audits', jsonb_build_array(audit), count(*), 0, 0, 0 FROM added
    WHERE audit IS NOT NULL GROUP BY 2;
    RETURN NULL;
END $$;
CREATE TRIGGER count_audits_added AFTER INSERT ON jobs REFERENCING NEW TABLE AS added
FOR EACH STATEMENT EXECUTE FUNCTION count_audits_added();
"""
RECOUNT = """
CREATE OR REPLACE FUNCTION recount_jobs() RETURNS void LANGUAGE sql AS $$
    DELETE FROM figure_changes;
    DELETE FROM figures;
    INSERT INTO figures SELECT 'jobs', job_place(jobs), count(*), 0, 0, 0 FROM jobs GROUP BY 2;
    INSERT INTO figures SELECT 'models', jsonb_build_array(model), sum(requests),
        sum(input_tokens), sum(output_tokens), sum(cost_usd) FROM jobs GROUP BY 2;
    INSERT INTO figures SELECT 'stages', jsonb_build_array(stage, result, attempt_class(seconds)),
        count(*), sum(seconds), 0, 0
    FROM (SELECT stage, result, extract(epoch FROM ended_at - started_at)::double precision
        AS seconds FROM attempts WHERE ended_at IS NOT NULL) AS took GROUP BY 2;{further}
$$
"""
FURTHER = """
    INSERT INTO figures SELECT 'verifications', jsonb_build_array(verdict), count(*), 0, 0, 0
    FROM verifications WHERE verdict IS NOT NULL GROUP BY 2;
    INSERT INTO figures SELECT 'audits', jsonb_build_array(audit), count(*), 0, 0, 0
    FROM jobs WHERE audit IS NOT NULL GROUP BY 2;"""


def upgrade() -> None:
    op.add_column("jobs", sa.Column("audit", sa.Text()))
    op.add_column("jobs", _no("by_runner"))
    op.add_column("rollouts", sa.Column("runner", sa.Text()))
    op.add_column("rollouts", _no("audited"))
    op.add_column("verifications", sa.Column("verdict", sa.Text()))
    op.add_column("api_keys", sa.Column("suspended_at", sa.DateTime(timezone=True)))
    op.add_column("api_keys", sa.Column("suspended_for", sa.Text()))
    op.create_index(
        "ix_rollouts_runner", "rollouts", ["runner"], postgresql_where=sa.text("runner IS NOT NULL")
    )
    op.execute(
        "UPDATE jobs SET audit = CASE WHEN verified_at IS NULL THEN 'required' ELSE 'verified' END "
        "WHERE imported_from IS NOT NULL AND success IS NOT NULL"
    )
    # Reports of before say whether all was equal, not why something was not.
    op.execute(
        "UPDATE verifications SET verdict = CASE WHEN (report->>'ok')::boolean THEN 'verified' "
        "ELSE 'inconclusive' END WHERE state = 'done'"
    )
    _log_changes(AUDITED, f"{COMPARED}, audit, by_runner")
    op.execute(COUNT)
    op.execute(RECOUNT.replace("{further}", FURTHER))
    op.execute("SELECT recount_jobs()")


def downgrade() -> None:
    op.execute(RECOUNT.replace("{further}", ""))
    op.execute("SELECT recount_jobs()")
    for name, table in (
        ("count_verifications_ended", "verifications"),
        ("count_jobs_audited", "jobs"),
        ("count_audits_added", "jobs"),
    ):
        op.execute(f"DROP TRIGGER {name} ON {table}")
    for name in ("count_verification_ended", "count_job_audited", "count_audits_added"):
        op.execute(f"DROP FUNCTION {name}()")
    _log_changes(IMPORTED, f"{COMPARED}, imported_from, verified_at")
    op.drop_index("ix_rollouts_runner", "rollouts")
    for table, name in (
        ("api_keys", "suspended_for"),
        ("api_keys", "suspended_at"),
        ("verifications", "verdict"),
        ("rollouts", "audited"),
        ("rollouts", "runner"),
        ("jobs", "by_runner"),
        ("jobs", "audit"),
    ):
        op.drop_column(table, name)


def _no(name: str) -> sa.Column[bool]:
    return sa.Column(name, sa.Boolean(), nullable=False, server_default=sa.text("false"))


def _log_changes(counts: str, columns: str) -> None:
    """Writes the trigger that logs changes of boards.

    Args:
        counts: SQL of whether a scored row counts.
        columns: The columns whose changes are logged.
    """
    old, new = (
        ", ".join(f"{row}.{name.strip()}" for name in columns.split(",")) for row in ("OLD", "NEW")
    )
    function = LOG.replace("{was}", counts.format(row="OLD"))
    op.execute("DROP TRIGGER log_board_update ON jobs")
    op.execute(function.replace("{is_now}", counts.format(row="NEW")))
    op.execute(
        "CREATE TRIGGER log_board_update AFTER UPDATE ON jobs FOR EACH ROW "
        "WHEN ((OLD.state = 'done' OR NEW.state = 'done') AND "
        f"({old}) IS DISTINCT FROM ({new})) EXECUTE FUNCTION log_board_change()"
    )
