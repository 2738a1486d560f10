"""members: what the jobs of a new sweep come to is read in one pass, by the jobs' key."""

# ruff: noqa: S608 - statements are made of constants of this file

from alembic import op

revision = "2026_11_26_members"
down_revision = "2026_11_26_told"
branch_labels = None
depends_on = None

USE = ("requests", "input_tokens", "output_tokens", "cost_usd")
COLUMNS = "(kind, key, a, b, c, d)"
# As the revision of the sweeps' figures has it: who moves a job meanwhile is waited for.
SETTLED = """
    PERFORM 1 FROM jobs JOIN added ON added.job_id = jobs.id
    WHERE jobs.xmin <> pg_current_xact_id()::xid ORDER BY jobs.id FOR SHARE OF jobs;"""
# The planner takes memberships for few or for many; all jobs are always more than one sweep's.
BY_KEY = "SET enable_hashjoin = off SET enable_mergejoin = off"


def _of_members(members: str, times: int) -> str:
    """Adds what some memberships come to, times 1 or -1, to the changes of figures."""
    sums = ", ".join(f"sum({name}) AS {name}" for name in (*USE, "lost_requests"))
    use = ", ".join(f"{times} * sum({name})" for name in USE)
    sweep = "jsonb_build_array(sweep_id)"
    return f"""
    WITH places AS MATERIALIZED (
        SELECT sweep_id, sweep_place(sweep_id, jobs) AS place, count(*) AS number, {sums}
        FROM {members} AS member JOIN jobs ON jobs.id = member.job_id GROUP BY 1, 2
    )
    INSERT INTO figure_changes {COLUMNS}
    SELECT 'sweep_jobs', place, {times} * number, 0, 0, 0 FROM places
    UNION ALL SELECT 'sweep_use', {sweep}, {use} FROM places GROUP BY sweep_id
    UNION ALL SELECT 'sweep_lost', {sweep}, {times} * sum(lost_requests), 0, 0, 0
    FROM places GROUP BY sweep_id;"""


def _in_passes(members: str, times: int) -> str:
    """The same in three passes, as before."""
    source = f"FROM {members} AS member JOIN jobs ON jobs.id = member.job_id GROUP BY 2"
    use = ", ".join(f"{times} * sum({name})" for name in USE)
    lost = f"{times} * sum(lost_requests), 0, 0, 0"
    into = f"INSERT INTO figure_changes {COLUMNS} SELECT"
    return f"""
    {into} 'sweep_jobs', sweep_place(sweep_id, jobs), {times} * count(*), 0, 0, 0 {source};
    {into} 'sweep_use', jsonb_build_array(sweep_id), {use} {source};
    {into} 'sweep_lost', jsonb_build_array(sweep_id), {lost} {source};"""


def _replace(name: str, body: str, settings: str) -> None:
    op.execute(
        f"CREATE OR REPLACE FUNCTION {name}() RETURNS trigger LANGUAGE plpgsql {settings} AS "
        f"$$ BEGIN {body} RETURN NULL; END $$"
    )


def upgrade() -> None:
    _replace("count_members_added", SETTLED + _of_members("added", 1), BY_KEY)
    _replace("count_members_removed", _of_members("removed", -1), BY_KEY)


def downgrade() -> None:
    _replace("count_members_added", SETTLED + _in_passes("added", 1), "")
    _replace("count_members_removed", _in_passes("removed", -1), "")
