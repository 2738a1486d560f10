"""Schemas: which are served, what migrations may do, and that a database of before stays whole."""

import io
import json
import re
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
from alembic import command
from alembic.script import ScriptDirectory
from sqlalchemy import text
from sqlalchemy.exc import OperationalError
from support.servers.run_servers import execute
from support.servers.stacks import wait_until
from support.stages import work

from buildarena_pipeline.catalog.models import load_registry
from buildarena_pipeline.catalog.specs import Budget
from buildarena_pipeline.runtime.context import Context, open_context
from buildarena_pipeline.submission.submission import Submissions
from buildarena_store import ArtifactStore, SchemaVersionError, SweepState, migrating
from buildarena_store.database import SCHEMA, Database
from buildarena_store.ids import new_id
from buildarena_store.jobs.job import JobKey, configuration_hash
from buildarena_store.migrating import alembic_config
from buildarena_store.tables import metadata
from buildarena_worker.wiring import verifier

BEFORE = Path(__file__).parents[1] / "data" / "store" / "before-states"
REVISION = "2026_11_21_keys_budgets_tasks"
ROWS = json.loads((BEFORE / "rows.json").read_text())
LIMITS = {"max_requests": 500}
LARGE = (
    *("attempts", "board_cells", "events", "external_calls", "job_artifacts", "jobs", "journal"),
    *("rollouts", "sweep_jobs"),
)
"""Tables that have millions of rows somewhere."""
TAKES_AWAY = re.compile(
    r"DROP (?:TABLE|COLUMN)|\bRENAME\b|SET NOT NULL|ALTER COLUMN \w+ TYPE"
    r"|ADD COLUMN (?!.*DEFAULT).*NOT NULL|ADD CONSTRAINT (?!.*NOT VALID).*(?:CHECK|FOREIGN)",
    re.IGNORECASE,
)
LOCKS_A_LARGE_TABLE = re.compile(
    rf"CREATE (?:UNIQUE )?INDEX (?!CONCURRENTLY)\S+ ON (?:{'|'.join(LARGE)})\b", re.IGNORECASE
)


def test_the_migrations_make_the_tables_that_the_code_knows(context) -> None:
    assert ScriptDirectory.from_config(alembic_config("")).get_current_head() == SCHEMA
    command.check(alembic_config(context.store.database.url))


@contextmanager
def of_schema(database: Database, revision: str, since: str | None = None) -> Iterator[None]:
    """The database says that it has another schema, and perhaps since when programs work."""

    def say(version: str, oldest: str) -> None:
        with database.transaction() as connection:
            connection.exec_driver_sql(f"UPDATE alembic_version SET version_num = '{version}'")
            connection.exec_driver_sql(f"UPDATE schema_compatibility SET since = '{oldest}'")

    with database.transaction() as connection:
        noted = connection.exec_driver_sql("SELECT since FROM schema_compatibility").scalar_one()
    say(revision, since or noted)
    try:
        yield
    finally:
        say(SCHEMA, noted)


def test_a_schema_is_served_unless_it_is_older_or_broke_with_this_program(database_url) -> None:
    database = Database(database_url)
    database.require_schema()
    with of_schema(database, "2099_01_01_flight"):  # it only adds
        database.require_schema()
    for revision, since, says in (
        ("2026_11_22_annotations", None, r"schema 2026_11_22_anno.*buildarena admin migr"),
        ("2099_01_01_flight", "2098_12_31_wings", r"of a later version.*upgrade"),
    ):
        with of_schema(database, revision, since), pytest.raises(SchemaVersionError, match=says):
            database.require_schema()
    database.close()


def test_migrations_only_add_or_say_that_they_break_and_lock_no_large_table() -> None:
    assert set(LARGE) <= set(metadata.tables)
    locked_once = False
    for revision in ScriptDirectory.from_config(alembic_config("")).walk_revisions():
        if revision.revision == "2026_11_22_compatibility":
            break  # before it nothing was promised
        out = io.StringIO()
        config = alembic_config("postgresql+psycopg://")
        config.output_buffer = out
        command.upgrade(config, f"{revision.down_revision}:{revision.revision}", sql=True)
        taken = TAKES_AWAY.findall(out.getvalue())
        breaking = getattr(revision.module, "BREAKING", False)
        assert breaking or not taken, f"{revision.revision} is not BREAKING and has {taken}"
        locked_once = locked_once or revision.revision == "2026_11_24_draws"
        found = LOCKS_A_LARGE_TABLE.findall(out.getvalue())
        assert locked_once or not found, f"{revision.revision}: see CONTRIBUTING.md, {found}"


def test_what_takes_away_or_locks_a_large_table_is_recognised() -> None:
    breaking = (
        *("ALTER TABLE jobs DROP COLUMN seed", "ALTER TABLE jobs RENAME seed TO luck"),
        "ALTER TABLE jobs ADD COLUMN luck INTEGER NOT NULL",
        "ALTER TABLE jobs ALTER COLUMN seed SET NOT NULL",
    )
    locking = "CREATE INDEX ix_luck ON jobs (seed)", "CREATE UNIQUE INDEX ix ON events (id)"
    harmless = (
        "ALTER TABLE jobs ADD COLUMN luck INTEGER DEFAULT 0 NOT NULL",
        *("CREATE TABLE luck (job_id TEXT NOT NULL)", "CREATE INDEX ix_luck ON budgets (id)"),
        "CREATE INDEX CONCURRENTLY ix_luck ON jobs (seed)",
    )
    assert all(TAKES_AWAY.search(sql) for sql in breaking)
    assert all(LOCKS_A_LARGE_TABLE.search(sql) for sql in locking)
    assert not any(TAKES_AWAY.search(s) or LOCKS_A_LARGE_TABLE.search(s) for s in harmless)


@pytest.fixture
def old_database(worker_id: str, postgres_url: str) -> Iterator[str]:
    """A database with the schema and the rows of the version before."""
    name = f"upgrade_{worker_id}"
    execute(postgres_url, f"CREATE DATABASE {name}")
    url = postgres_url.replace("/postgres", f"/{name}")
    database = Database(url)
    command.upgrade(alembic_config(database.url), REVISION)
    with database.transaction() as connection:
        connection.execute(text("SET session_replication_role = replica"))  # rows as they were
        for table, rows in ROWS.items():
            given = f"json_populate_recordset(NULL::{table}, :rows)"
            statement = text(f"INSERT INTO {table} SELECT * FROM {given}")
            connection.execute(statement, {"rows": json.dumps(rows)})
        for table in ("events", "board_changes"):
            sequence = f"setval(pg_get_serial_sequence('{table}', 'id'), max(id))"
            connection.execute(text(f"SELECT {sequence} FROM {table}"))
    database.close()
    yield url
    execute(postgres_url, f"DROP DATABASE {name} WITH (FORCE)")


@contextmanager
def migrated(url: str, settings) -> Iterator[Context]:
    context = open_context(settings.model_copy(update={"database_url": url}))
    context.store.database.migrate()
    context.store.database.require_schema()
    yield context
    context.close()


def sweep_id(name: str) -> str:
    return next(row["id"] for row in ROWS["sweeps"] if row["name"] == name)


@pytest.mark.ci
def test_jobs_keep_their_figures_and_stopped_sweeps_go_on(old_database, settings, tmp_path) -> None:
    artifacts = ArtifactStore(tmp_path / "artifacts")
    for file in (BEFORE / "artifacts").iterdir():
        assert artifacts.put(file.read_bytes(), "application/json").hash == file.name
    same = ("id", "task", "task_version", "model_hash", "track", "seed", "outcome", "indicator")
    with migrated(old_database, settings) as context:
        upgraded = replace(context, artifacts=artifacts)
        jobs = {job.id: job for job in upgraded.store.jobs.page(limit=100)}
        assert jobs.keys() == {row["id"] for row in ROWS["jobs"]}
        for row in ROWS["jobs"]:
            now = {name: getattr(jobs[row["id"]], name) for name in (*same, "requests")}
            assert now == {name: row[name] for name in now}
            state = "on_hold" if row["state"] == "held" else row["state"]
            assert jobs[row["id"]].state == state
        assert {s.name: s.state for s in upgraded.store.sweeps.page(limit=10)} == {
            "finished": SweepState.ACTIVE,
            "paused": SweepState.PAUSED,
            "limited": SweepState.BUDGET_EXHAUSTED,
        }
        kinds = {event.kind for event in upgraded.store.events.after(0)}
        assert not kinds & {"held", "limit"}
        assert {"on_hold", "budget_exhausted"} <= kinds
        ended = [job for job in jobs.values() if job.success is not None]
        assert ended
        for job in ended:  # jobs of older task versions say what they would need
            report = verifier(upgraded).verify(job.id).as_document()
            (failed,) = (check for check in report["checks"] if not check["ok"])
            assert f"{job.task} is no longer at version {job.task_version}" in failed["found"]
        submissions = Submissions(upgraded, load_registry())
        submissions.resume(sweep_id("paused"), None)
        submissions.resume(sweep_id("limited"), Budget(max_requests=1000))
        work(upgraded)
        for name in ("paused", "limited", "finished"):
            progress = upgraded.store.sweeps.progress(sweep_id(name))
            assert progress.done == progress.total, name


@pytest.mark.ci
def test_a_revision_that_meets_who_works_in_another_order_is_begun_again(
    old_database, monkeypatch
) -> None:
    """It has the jobs and waits for the rollouts, whose writer asks for the jobs."""
    waiting = text("SELECT 1 FROM pg_locks WHERE relation = 'rollouts'::regclass AND NOT granted")
    database = Database(old_database)
    command.upgrade(alembic_config(database.url), "2026_11_23_lost_requests")

    def migrate_beside_a_writer() -> str:
        with ThreadPoolExecutor(1) as pool, database.transaction() as writer:
            writer.execute(text("SET LOCAL deadlock_timeout = '60s'"))
            writer.execute(text("LOCK TABLE rollouts IN ROW EXCLUSIVE MODE"))
            done = pool.submit(database.migrate)
            wait_until(lambda: writer.execute(waiting).first(), 30, "the revision waits")
            writer.execute(text("LOCK TABLE jobs IN ROW EXCLUSIVE MODE"))
            writer.commit()
            return done.result()

    with monkeypatch.context() as patched:
        patched.setattr(migrating, "TRIES", 1)
        with pytest.raises(OperationalError, match="deadlock"):
            migrate_beside_a_writer()
    assert database.schema() == "2026_11_23_lost_requests"
    assert migrate_beside_a_writer() == database.schema() == SCHEMA
    database.close()


@pytest.mark.ci
def test_jobs_with_limits_move_to_the_ids_that_follow_from_them(old_database, settings) -> None:
    ended = {row["id"]: row for row in ROWS["jobs"] if row["state"] == "done"}
    first, second, *_ = ended
    database = Database(old_database)
    with database.transaction() as connection:
        update = text("UPDATE jobs SET limits = :limits WHERE id = ANY(:ids)")
        connection.execute(update, {"limits": json.dumps(LIMITS), "ids": list(ended)})
        check = text("INSERT INTO verifications (id, job_id, state) VALUES (:id, :job, 'queued')")
        for job_id in (first, first, second):  # equal verifications were possible
            connection.execute(check, {"id": new_id("check"), "job": job_id})
    database.close()
    wanted = {
        JobKey(
            task=row["task"],
            task_version=row["task_version"],
            model_hash=configuration_hash(row["model_config"], LIMITS),
            track=row["track"],
            seed=row["seed"],
        ).job_id: row["requests"]
        for row in ended.values()
    }
    with migrated(old_database, settings) as context:
        moved = {job.id: job for job in context.store.jobs.page(limit=100) if job.limits}
        assert {job.id: job.requests for job in moved.values()} == wanted
        for job_id, requests in wanted.items():
            assert len(context.store.journal.read(job_id)) == requests
        with context.store.database.transaction() as connection:
            found = connection.execute(text("SELECT job_id FROM verifications")).scalars().all()
    assert len(found) == len(set(found)) == 2
