"""tenants: who wants and paid for what, whose names are whose, and imports apart from rankings."""

# ruff: noqa: S608 - statements are made of constants of this file

import sqlalchemy as sa
from alembic import op

from buildarena_store.ids import content_hash

revision = "2026_11_22_tenants"
down_revision = "2026_11_21_states_and_words"
branch_labels = None
depends_on = None

SCORED = "'success', 'unsuccessful', 'construction_failed', 'limit'"
COMPARED = (
    "state, outcome, reason, success, indicator, metrics, flags, refusals, requests, "
    "input_tokens, output_tokens, cost_usd, actions, refused_actions, finished_at"
)
# Every table that names jobs, and its column.
NAMING = (
    "sweep_jobs",
    "reservations",
    "attempts",
    "journal",
    "external_calls",
    "rollouts",
    "job_artifacts",
    "verifications",
    "board_changes",
    "events",
)
KEYED = NAMING[:-2]
EXTERNAL = "external%"


def upgrade() -> None:
    op.add_column("jobs", sa.Column("imported_from", sa.Text()))
    op.add_column("jobs", sa.Column("verified_at", sa.DateTime(timezone=True)))
    op.add_column("verifications", sa.Column("owner", sa.Text()))
    op.add_column("journal", sa.Column("payer", sa.Text()))
    op.add_column("journal", sa.Column("owner", sa.Text()))
    op.add_column(
        "sweep_jobs",
        sa.Column("wanted", sa.Boolean(), server_default=sa.text("true"), nullable=False),
    )
    op.create_table(
        "job_wants",
        sa.Column("job_id", sa.Text(), nullable=False),
        sa.Column("owner", sa.Text(), nullable=False),
        sa.ForeignKeyConstraint(["job_id"], ["jobs.id"], name=op.f("fk_job_wants_job_id")),
        sa.PrimaryKeyConstraint("job_id", "owner", name=op.f("pk_job_wants")),
    )
    op.create_table(
        "names",
        sa.Column("kind", sa.Text(), nullable=False),
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("owner", sa.Text()),
        sa.PrimaryKeyConstraint("kind", "name", name=op.f("pk_names")),
    )
    _rekey_limited_jobs()
    _backfill()
    op.create_index(
        "ix_journal_owner", "journal", ["owner"], postgresql_where=sa.text("owner IS NOT NULL")
    )
    _index_waiting_jobs("queue", sa.text("COALESCE(owner, '')"), "created_at", "id")
    op.create_index(
        "ix_verifications_open",
        "verifications",
        ["job_id"],
        unique=True,
        postgresql_where=sa.text("state <> 'done'"),
    )
    _write_triggers(
        counts="AND ({row}.imported_from IS NULL OR {row}.verified_at IS NOT NULL)",
        columns=f"{COMPARED}, imported_from, verified_at",
    )


def downgrade() -> None:
    _write_triggers(counts="", columns=COMPARED)
    op.drop_index("ix_verifications_open", "verifications")
    _index_waiting_jobs("queue", "created_at", "id")
    op.drop_index("ix_journal_owner", "journal")
    op.drop_table("names")
    op.drop_table("job_wants")
    for table, column in (
        ("sweep_jobs", "wanted"),
        ("journal", "owner"),
        ("journal", "payer"),
        ("verifications", "owner"),
        ("jobs", "verified_at"),
        ("jobs", "imported_from"),
    ):
        op.drop_column(table, column)


def _index_waiting_jobs(*columns: str | sa.TextClause) -> None:
    op.drop_index("ix_jobs_waiting", "jobs")
    op.create_index(
        "ix_jobs_waiting", "jobs", list(columns), postgresql_where=sa.text("state = 'queued'")
    )


def _backfill() -> None:
    """What the new tables and columns say of the rows that were there before."""
    for statement in (
        (
            "UPDATE journal SET payer = jobs.payer, owner = jobs.owner FROM jobs "
            "WHERE jobs.id = journal.job_id "
            "AND (jobs.payer IS NOT NULL OR jobs.owner IS NOT NULL)"
        ),
        # A cancelled sweep no longer pays.
        (
            "UPDATE jobs SET payer = taker.id, owner = taker.owner "
            "FROM sweep_jobs, sweeps AS taker, sweeps AS payer "
            "WHERE jobs.state <> 'done' AND payer.id = jobs.payer "
            "AND payer.state = 'cancelled' AND sweep_jobs.job_id = jobs.id "
            "AND taker.id = sweep_jobs.sweep_id AND taker.state <> 'cancelled'"
        ),
        "INSERT INTO job_wants SELECT id, COALESCE(owner, '') FROM jobs WHERE payer IS NULL",
        (
            "INSERT INTO names SELECT DISTINCT ON (name) 'task', name, owner FROM tasks "
            "ORDER BY name, created_at"
        ),
        (
            "INSERT INTO names SELECT DISTINCT ON (model) 'agent', model_config->>'model', owner "
            f"FROM jobs WHERE track LIKE '{EXTERNAL}' AND model_config->>'model' IS NOT NULL "
            "ORDER BY model, created_at ON CONFLICT DO NOTHING"
        ),
        # Of equal verifications that wait, the oldest stays.
        (
            "DELETE FROM verifications WHERE state <> 'done' AND id NOT IN (SELECT DISTINCT ON "
            "(job_id) id FROM verifications WHERE state <> 'done' ORDER BY job_id, created_at)"
        ),
    ):
        op.execute(statement)


def _rekey_limited_jobs() -> None:
    """Gives jobs with limits the ids that they have now that limits are part of their keys."""
    connection = op.get_bind()
    query = sa.text(
        "SELECT id, task, task_version, model_config, track, seed, limits FROM jobs "
        "WHERE limits <> '{}'"
    )
    moved = []
    for row in connection.execute(query):
        config = content_hash({**row.model_config, "limits": row.limits})
        key = [row.task, row.task_version, config, row.track, row.seed]
        moved.append({"old": row.id, "new": "job_" + content_hash(key)[:20], "hash": config})
    if not moved:
        return
    known = {table: _job_key_of(table) for table in KEYED}
    for table, name in known.items():
        op.drop_constraint(name, table, type_="foreignkey")
    connection.execute(
        sa.text("UPDATE jobs SET id = :new, model_hash = :hash WHERE id = :old"), moved
    )
    for table in NAMING:
        connection.execute(
            sa.text(f"UPDATE {table} SET job_id = :new WHERE job_id = :old"),
            moved,
        )
    for table, name in known.items():
        op.create_foreign_key(name, table, "jobs", ["job_id"], ["id"])
    _rehash_sweeps(connection, [row["new"] for row in moved])


def _job_key_of(table: str) -> str:
    """The name of a table's foreign key to jobs."""
    keys = sa.inspect(op.get_bind()).get_foreign_keys(table)
    return str(next(key["name"] for key in keys if key["referred_table"] == "jobs"))


def _rehash_sweeps(connection: sa.Connection, job_ids: list[str]) -> None:
    """Sweeps are found again by the hash of their jobs' ids."""
    members = sa.text(
        "SELECT sweep_id, array_agg(job_id) AS ids FROM sweep_jobs GROUP BY sweep_id "
        "HAVING array_agg(job_id) && :ids"
    )
    for row in connection.execute(members, {"ids": job_ids}).all():
        connection.execute(
            sa.text("UPDATE sweeps SET jobs_hash = :hash WHERE id = :id"),
            {"hash": content_hash(sorted(row.ids)), "id": row.sweep_id},
        )


def _write_triggers(*, counts: str, columns: str) -> None:
    """Writes the log's function and its update trigger again.

    Args:
        counts: What a scored row must also be to be ranked.
        columns: The columns whose changes are logged.
    """
    old, new = (
        ", ".join(f"{row}.{name.strip()}" for name in columns.split(",")) for row in ("OLD", "NEW")
    )
    op.execute("DROP TRIGGER log_board_update ON jobs")
    op.execute(
        f"""
        CREATE OR REPLACE FUNCTION log_board_change() RETURNS trigger LANGUAGE plpgsql AS $$
        DECLARE
            scored CONSTANT text[] := ARRAY[{SCORED}];
            old_score jsonb;
            new_score jsonb;
            job jobs%ROWTYPE;
            was boolean := false;
            is_now boolean := false;
            kind text;
        BEGIN
            IF TG_OP <> 'INSERT' AND OLD.state = 'done' THEN
                was := OLD.outcome = ANY (scored) {counts.format(row="OLD")};
                old_score := jsonb_build_object('outcome', OLD.outcome, 'reason', OLD.reason,
                    'success', OLD.success, 'indicator', OLD.indicator, 'flags', OLD.flags);
                job := OLD;
            END IF;
            IF TG_OP <> 'DELETE' AND NEW.state = 'done' THEN
                is_now := NEW.outcome = ANY (scored) {counts.format(row="NEW")};
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
                (transaction, job_id, track, task, model, kind, before, after, why)
            VALUES (pg_current_xact_id()::text::bigint, job.id, job.track, job.task, job.model,
                    kind, old_score, new_score,
                    NULLIF(current_setting('buildarena.why', true), ''));
            RETURN NULL;
        END $$
        """
    )
    op.execute(
        f"""
        CREATE TRIGGER log_board_update AFTER UPDATE ON jobs FOR EACH ROW
        WHEN ((OLD.state = 'done' OR NEW.state = 'done') AND
        ({old}) IS DISTINCT FROM ({new})) EXECUTE FUNCTION log_board_change()
        """
    )
