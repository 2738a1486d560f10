"""An upgrade to a later schema, during which the service of before works on."""

import shutil
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from threading import Event

import pytest
from sqlalchemy import inspect, text
from support.jobs import finish
from support.servers.run_servers import TEMPLATE, execute
from support.servers.stacks import wait_until

from buildarena_backend.catalog.specs import JobSpec
from buildarena_backend.database import migrations
from buildarena_backend.database.database import SCHEMA

COLUMN = f"""
import sqlalchemy as sa
from alembic import op

revision, down_revision = "0002_note", "{SCHEMA}"


def upgrade():
    op.add_column("jobs", sa.Column("note", sa.Text))
"""
INDEX = """
from alembic import op

revision, down_revision = "0003_note_index", "0002_note"


def upgrade():
    with op.get_context().autocommit_block():
        op.drop_index("ix_jobs_note", if_exists=True, postgresql_concurrently=True)
        op.create_index("ix_jobs_note", "jobs", ["note"], postgresql_concurrently=True)
"""
"""As CONTRIBUTING.md has it: what an interrupted try has left is invalid, and goes first."""


@pytest.fixture
def database_url(worker_id: str, postgres_url: str) -> Iterator[str]:
    """A database whose schema may change."""
    name = f"upgraded_{worker_id}"
    execute(postgres_url, f"CREATE DATABASE {name} TEMPLATE {TEMPLATE}")
    yield postgres_url.replace("/postgres", f"/{name}")
    execute(postgres_url, f"DROP DATABASE {name} WITH (FORCE)")


@pytest.fixture
def later(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two revisions more."""
    folder = tmp_path / "migrations"
    shutil.copytree(migrations.MIGRATIONS, folder)
    (folder / "versions" / "0002_note.py").write_text(COLUMN)
    (folder / "versions" / "0003_note_index.py").write_text(INDEX)
    monkeypatch.setattr(migrations, "MIGRATIONS", folder)


@pytest.mark.ci
@pytest.mark.usefixtures("later")
def test_an_upgrade_under_load_loses_nothing(context, submissions, monkeypatch) -> None:
    ended = Event()
    done: dict[str, str] = {}

    def work(seed: int) -> None:
        while not ended.is_set():
            spec = JobSpec(task="support-1", model="builtin/idle", seed=seed)
            submitted, _ = submissions.submit_job(spec)
            done.setdefault(submitted.id, "")
            lease = wait_until(partial(claim, "construct", owner=f"w{seed % 2}"), 10, "a claim")
            done[finish(context, lease)] = "success"
            seed += 2

    # A claim returns nothing while the other worker's claim has locked what waits.
    claim, database = context.store.leases.claim, context.store.database
    with ThreadPoolExecutor() as pool:
        workers = [pool.submit(work, seed) for seed in range(2)]
        try:
            for _ in range(2):  # where it is done, nothing is to do
                before = len(done)
                wait_until(lambda: len(done) > before + 20, 30, "jobs are done")
                database.migrate()
            before = len(done)
            wait_until(lambda: len(done) > before + 20, 30, "jobs are done after it")
        finally:
            ended.set()
        for worker in workers:
            worker.result()
    monkeypatch.undo()  # the program of before, which knows its own revision only
    database.require_schema()
    assert database.schema() == "0003_note_index"
    indexes = inspect(database.engine).get_indexes("jobs")
    assert "ix_jobs_note" in {index["name"] for index in indexes}
    assert set(done.values()) == {"success"}
    outcomes = database.all_rows(text("SELECT id, outcome FROM jobs WHERE note IS NULL"))
    assert {row.id: row.outcome for row in outcomes} == done
