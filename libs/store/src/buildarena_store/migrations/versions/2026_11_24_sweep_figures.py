"""sweep figures: a sweep's progress is kept, as other figures are, instead of counted."""

# ruff: noqa: S608 - statements are made of constants of this file

from alembic import op

revision = "2026_11_24_sweep_figures"
down_revision = "2026_11_24_job_ids"
branch_labels = None
depends_on = None

USE = ("requests", "input_tokens", "output_tokens", "cost_usd")
COLUMNS = "(kind, key, a, b, c, d)"


def _of_members(table: str, members: str, times: int) -> str:
    """Adds what some memberships come to, times 1 or -1, to a table of figures."""
    source = f"FROM {members} AS member JOIN jobs ON jobs.id = member.job_id GROUP BY 2"
    use = ", ".join(f"{times} * sum({name})" for name in USE)
    lost = f"{times} * sum(lost_requests), 0, 0, 0"
    return f"""
    INSERT INTO {table} {COLUMNS}
    SELECT 'sweep_jobs', sweep_place(sweep_id, jobs), {times} * count(*), 0, 0, 0 {source};
    INSERT INTO {table} {COLUMNS}
    SELECT 'sweep_use', jsonb_build_array(sweep_id), {use} {source};
    INSERT INTO {table} {COLUMNS}
    SELECT 'sweep_lost', jsonb_build_array(sweep_id), {lost} {source};
    """


def _of_job(kind: str, key: str, amounts: str) -> str:
    """The change to the figures of each sweep that a changed job is in."""
    return f"""
    INSERT INTO figure_changes {COLUMNS}
    SELECT '{kind}', {key}, {amounts} FROM sweep_jobs WHERE job_id = NEW.id;"""


def _function(name: str, body: str) -> str:
    return (
        f"CREATE OR REPLACE FUNCTION {name}() RETURNS trigger LANGUAGE plpgsql AS "
        f"$$ BEGIN {body} RETURN NULL; END $$"
    )


MOVED = """
    INSERT INTO figure_changes (kind, key, a, b, c, d)
    VALUES ('jobs', job_place(OLD), -1, 0, 0, 0), ('jobs', job_place(NEW), 1, 0, 0, 0);"""
USED = """
    INSERT INTO figure_changes (kind, key, a, b, c, d)
    VALUES ('models', jsonb_build_array(NEW.model), NEW.requests - OLD.requests,
        NEW.input_tokens - OLD.input_tokens, NEW.output_tokens - OLD.output_tokens,
        NEW.cost_usd - OLD.cost_usd);"""
KEY = "jsonb_build_array(sweep_id)"
SWEEPS_MOVED = _of_job("sweep_jobs", "sweep_place(sweep_id, OLD)", "-1, 0, 0, 0") + _of_job(
    "sweep_jobs", "sweep_place(sweep_id, NEW)", "1, 0, 0, 0"
)
SWEEPS_USED = _of_job("sweep_use", KEY, ", ".join(f"NEW.{name} - OLD.{name}" for name in USE))
SWEEPS_LOST = _of_job("sweep_lost", KEY, "NEW.lost_requests - OLD.lost_requests, 0, 0, 0")
# A job that moves meanwhile does not see the sweep yet, and is counted where it comes to. Those
# that this transaction wrote can't move.
SETTLED = """
    PERFORM 1 FROM jobs JOIN added ON added.job_id = jobs.id
    WHERE jobs.xmin <> pg_current_xact_id()::xid ORDER BY jobs.id FOR SHARE OF jobs;"""
BEGUN = "DELETE FROM figure_changes; DELETE FROM figures;"
# As `recount_jobs` of the revision before has it.
COUNTED = """
    INSERT INTO figures SELECT 'jobs', job_place(jobs), count(*), 0, 0, 0 FROM jobs GROUP BY 2;
    INSERT INTO figures SELECT 'models', jsonb_build_array(model), sum(requests),
        sum(input_tokens), sum(output_tokens), sum(cost_usd) FROM jobs GROUP BY 2;
    INSERT INTO figures SELECT 'stages', jsonb_build_array(stage, result, attempt_class(seconds)),
        count(*), sum(seconds), 0, 0
    FROM (SELECT stage, result, extract(epoch FROM ended_at - started_at)::double precision
        AS seconds FROM attempts WHERE ended_at IS NOT NULL) AS took GROUP BY 2;
    INSERT INTO figures SELECT 'verifications', jsonb_build_array(verdict), count(*), 0, 0, 0
    FROM verifications WHERE verdict IS NOT NULL GROUP BY 2;
    INSERT INTO figures SELECT 'audits', jsonb_build_array(audit), count(*), 0, 0, 0
    FROM jobs WHERE audit IS NOT NULL GROUP BY 2;"""


def upgrade() -> None:
    op.execute(
        "CREATE FUNCTION sweep_place(sweep text, job jobs) RETURNS jsonb LANGUAGE sql IMMUTABLE AS "
        "$$ SELECT jsonb_build_array(sweep, job.state, job.stage, COALESCE(job.outcome, '')) $$"
    )
    op.execute(_function("count_job_moved", MOVED + SWEEPS_MOVED))
    op.execute(_function("count_job_use", USED + SWEEPS_USED))
    op.execute(_function("count_job_lost", SWEEPS_LOST))
    op.execute(
        "CREATE TRIGGER count_jobs_lost AFTER UPDATE ON jobs FOR EACH ROW "
        "WHEN (OLD.lost_requests <> NEW.lost_requests) EXECUTE FUNCTION count_job_lost()"
    )
    added = SETTLED + _of_members("figure_changes", "added", 1)
    op.execute(_function("count_members_added", added))
    op.execute(_function("count_members_removed", _of_members("figure_changes", "removed", -1)))
    for name, on, rows in (("added", "INSERT", "NEW"), ("removed", "DELETE", "OLD")):
        op.execute(
            f"CREATE TRIGGER count_members_{name} AFTER {on} ON sweep_jobs REFERENCING {rows} "
            f"TABLE AS {name} FOR EACH STATEMENT EXECUTE FUNCTION count_members_{name}()"
        )
    _recount_by(BEGUN + COUNTED + _of_members("figures", "sweep_jobs", 1))
    op.execute("CREATE INDEX ix_figures_first ON figures ((key ->> 0))")
    op.execute(_of_members("figures", "sweep_jobs", 1))


def downgrade() -> None:
    op.drop_index("ix_figures_first", "figures")
    _recount_by(BEGUN + COUNTED)
    for name in ("added", "removed"):
        op.execute(f"DROP TRIGGER count_members_{name} ON sweep_jobs")
        op.execute(f"DROP FUNCTION count_members_{name}()")
    op.execute("DROP TRIGGER count_jobs_lost ON jobs")
    op.execute("DROP FUNCTION count_job_lost()")
    op.execute(_function("count_job_moved", MOVED))
    op.execute(_function("count_job_use", USED))
    op.execute("DROP FUNCTION sweep_place(text, jobs)")
    for table in ("figures", "figure_changes"):
        op.execute(f"DELETE FROM {table} WHERE kind IN ('sweep_jobs', 'sweep_use', 'sweep_lost')")


def _recount_by(body: str) -> None:
    op.execute(
        f"CREATE OR REPLACE FUNCTION recount_jobs() RETURNS void LANGUAGE sql AS $$ {body} $$"
    )
