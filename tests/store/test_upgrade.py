"""A database of the version before: it is migrated, and its jobs stay as they were and verify."""

import json
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest
from alembic import command
from sqlalchemy import create_engine, text
from sqlalchemy.exc import OperationalError
from support.servers.stacks import wait_until
from support.stages import work

from buildarena_pipeline.catalog.models import load_registry
from buildarena_pipeline.catalog.specs import Budget
from buildarena_pipeline.runtime.context import Context, open_context
from buildarena_pipeline.submission.submission import Submissions
from buildarena_store import ArtifactStore, SweepState, migrating
from buildarena_store.database import SCHEMA, Database
from buildarena_store.ids import new_id
from buildarena_store.jobs.job import JobKey, configuration_hash
from buildarena_store.migrating import alembic_config
from buildarena_worker.wiring import verifier

pytestmark = pytest.mark.ci

BEFORE = Path(__file__).parents[1] / "data" / "store" / "before-states"
REVISION = "2026_11_21_keys_budgets_tasks"
ROWS = json.loads((BEFORE / "rows.json").read_text())


@pytest.fixture
def old_database(worker_id: str, postgres_url: str) -> Iterator[str]:
    """A database with the schema and the rows of the version before."""
    server, name = postgres_url, f"upgrade_{worker_id}"
    admin = create_engine(
        server.replace("postgresql://", "postgresql+psycopg://"), isolation_level="AUTOCOMMIT"
    )
    with admin.connect() as connection:
        connection.execute(text(f"CREATE DATABASE {name}"))
    url = server.replace("/postgres", f"/{name}")
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
    with admin.connect() as connection:
        connection.execute(text(f"DROP DATABASE {name} WITH (FORCE)"))
    admin.dispose()


@pytest.fixture
def upgraded(old_database: str, settings, tmp_path: Path) -> Iterator[Context]:
    """The process' connections after the migration, with the artifacts of before."""
    artifacts = ArtifactStore(tmp_path / "artifacts")
    for file in (BEFORE / "artifacts").iterdir():
        assert artifacts.put(file.read_bytes(), "application/json").hash == file.name
    context = open_context(settings.model_copy(update={"database_url": old_database}))
    context.store.database.migrate()
    context.store.database.require_schema()
    yield replace(context, artifacts=artifacts)
    context.close()


def sweep_id(name: str) -> str:
    return next(row["id"] for row in ROWS["sweeps"] if row["name"] == name)


def test_jobs_keep_their_ids_outcomes_and_figures(upgraded) -> None:
    jobs = {job.id: job for job in upgraded.store.jobs.page(limit=100)}
    assert jobs.keys() == {row["id"] for row in ROWS["jobs"]}
    same = (
        "task",
        "task_version",
        "model_hash",
        "track",
        "seed",
        "outcome",
        "indicator",
        "requests",
    )
    for row in ROWS["jobs"]:
        assert {name: getattr(jobs[row["id"]], name) for name in same} == {
            name: row[name] for name in same
        }
        state = "on_hold" if row["state"] == "held" else row["state"]
        assert jobs[row["id"]].state == state


def test_states_and_events_have_their_new_names(upgraded) -> None:
    states = {s.name: s.state for s in upgraded.store.sweeps.page(limit=10)}
    assert states == {
        "finished": SweepState.ACTIVE,
        "paused": SweepState.PAUSED,
        "limited": SweepState.BUDGET_EXHAUSTED,
    }
    kinds = {event.kind for event in upgraded.store.events.after(0)}
    assert not kinds & {"held", "limit"}
    assert {"on_hold", "budget_exhausted"} <= kinds


def test_ended_jobs_of_older_task_versions_say_what_they_would_need(upgraded) -> None:
    ended = [job for job in upgraded.store.jobs.page(limit=100) if job.success is not None]
    assert ended
    for job in ended:
        report = verifier(upgraded).verify(job.id).as_document()
        (failed,) = (check for check in report["checks"] if not check["ok"])
        assert f"{job.task} is no longer at version {job.task_version}" in failed["found"]


def test_stopped_sweeps_go_on(upgraded) -> None:
    submissions = Submissions(upgraded, load_registry())
    submissions.resume(sweep_id("paused"), None)
    submissions.resume(sweep_id("limited"), Budget(max_requests=1000))
    work(upgraded)
    for name in ("paused", "limited", "finished"):
        progress = upgraded.store.sweeps.progress(sweep_id(name))
        assert progress.done == progress.total, name


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
            migrated = pool.submit(database.migrate)
            wait_until(lambda: writer.execute(waiting).first(), 30, "the revision waits")
            writer.execute(text("LOCK TABLE jobs IN ROW EXCLUSIVE MODE"))
            writer.commit()
            return migrated.result()

    with monkeypatch.context() as patched:
        patched.setattr(migrating, "TRIES", 1)
        with pytest.raises(OperationalError, match="deadlock"):
            migrate_beside_a_writer()
    assert database.schema() == "2026_11_23_lost_requests"
    assert migrate_beside_a_writer() == database.schema() == SCHEMA
    database.close()


def test_jobs_with_limits_move_to_the_ids_that_follow_from_them(old_database, settings) -> None:
    limits = {"max_requests": 500}
    database = Database(old_database)
    with database.transaction() as connection:
        ended = [row["id"] for row in ROWS["jobs"] if row["state"] == "done"]
        connection.execute(
            text("UPDATE jobs SET limits = :limits WHERE id = ANY(:ids)"),
            {"limits": json.dumps(limits), "ids": ended},
        )
        for job_id in (ended[0], ended[0], ended[1]):  # equal verifications were possible
            connection.execute(
                text("INSERT INTO verifications (id, job_id, state) VALUES (:id, :job, 'queued')"),
                {"id": new_id("check"), "job": job_id},
            )
    database.close()
    context = open_context(settings.model_copy(update={"database_url": old_database}))
    context.store.database.migrate()
    moved = [job for job in context.store.jobs.page(limit=100) if job.limits]
    assert len(moved) == len(ended)
    assert not {job.id for job in moved} & set(ended)
    asked = {row["id"]: row["requests"] for row in ROWS["jobs"]}
    assert sorted(job.requests for job in moved) == sorted(asked[id_] for id_ in ended)
    for job in moved:
        assert len(context.store.journal.read(job.id)) == job.requests
    keys = {
        JobKey(
            task=row["task"],
            task_version=row["task_version"],
            model_hash=configuration_hash(row["model_config"], limits),
            track=row["track"],
            seed=row["seed"],
        ).job_id
        for row in ROWS["jobs"]
        if row["id"] in ended
    }
    assert {job.id for job in moved} == keys
    with context.store.database.transaction() as connection:
        open_ones = connection.execute(text("SELECT job_id FROM verifications")).scalars().all()
    assert len(open_ones) == len(set(open_ones)) == 2
    context.close()
