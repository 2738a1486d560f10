import io
import re
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from alembic import command
from alembic.script import ScriptDirectory
from sqlalchemy.exc import OperationalError

from buildarena_store import Database, SchemaVersionError
from buildarena_store import database as database_module
from buildarena_store.database import SCHEMA
from buildarena_store.migrating import alembic_config
from buildarena_store.tables import metadata


def test_the_code_names_the_newest_migration() -> None:
    assert ScriptDirectory.from_config(alembic_config("")).get_current_head() == SCHEMA


def test_the_migrations_make_the_tables_that_the_code_knows(context) -> None:
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


@pytest.fixture
def database(database_url: str) -> Iterator[Database]:
    opened = Database(database_url)
    yield opened
    opened.close()


def test_an_older_schema_is_refused_with_advice(database) -> None:
    database.require_schema()
    with (
        of_schema(database, "2026_11_22_annotations"),
        pytest.raises(SchemaVersionError, match=r"schema 2026_11_22_anno.*buildarena admin migr"),
    ):
        database.require_schema()


def test_a_later_schema_that_only_adds_serves_the_programs_before(database) -> None:
    with of_schema(database, "2099_01_01_flight"):
        database.require_schema()


def test_a_later_schema_that_broke_with_this_program_is_refused(database) -> None:
    with (
        of_schema(database, "2099_01_01_flight", since="2098_12_31_wings"),
        pytest.raises(SchemaVersionError, match=r"of a later version.*upgrade"),
    ):
        database.require_schema()


TAKES_AWAY = re.compile(
    r"DROP (?:TABLE|COLUMN)|\bRENAME\b|SET NOT NULL|ALTER COLUMN \w+ TYPE"
    r"|ADD COLUMN (?!.*DEFAULT).*NOT NULL|ADD CONSTRAINT (?!.*NOT VALID).*(?:CHECK|FOREIGN)",
    re.IGNORECASE,
)


def test_migrations_only_add_or_say_that_they_break() -> None:
    script = ScriptDirectory.from_config(alembic_config(""))
    for revision in script.walk_revisions():
        if revision.revision == "2026_11_22_compatibility":
            break  # before it nothing was promised
        out = io.StringIO()
        config = alembic_config("postgresql+psycopg://")
        config.output_buffer = out
        command.upgrade(config, f"{revision.down_revision}:{revision.revision}", sql=True)
        taken = TAKES_AWAY.findall(out.getvalue())
        breaking = getattr(revision.module, "BREAKING", False)
        assert breaking or not taken, f"{revision.revision} is not BREAKING and has {taken}"


def test_what_takes_away_is_recognised(subtests) -> None:
    for sql, breaks in [
        ("ALTER TABLE jobs DROP COLUMN seed", True),
        ("ALTER TABLE jobs RENAME seed TO luck", True),
        ("ALTER TABLE jobs ADD COLUMN luck INTEGER NOT NULL", True),
        ("ALTER TABLE jobs ALTER COLUMN seed SET NOT NULL", True),
        ("ALTER TABLE jobs ADD COLUMN luck INTEGER", False),
        ("ALTER TABLE jobs ADD COLUMN luck INTEGER DEFAULT 0 NOT NULL", False),
        ("CREATE TABLE luck (job_id TEXT NOT NULL)", False),
        ("CREATE INDEX ix_luck ON jobs (seed)", False),
    ]:
        with subtests.test(sql=sql):
            assert bool(TAKES_AWAY.search(sql)) is breaks


LARGE = (
    "attempts",
    "board_cells",
    "events",
    "external_calls",
    "job_artifacts",
    "jobs",
    "journal",
    "rollouts",
    "sweep_jobs",
)
"""Tables that have millions of rows somewhere."""
LOCKS_A_LARGE_TABLE = re.compile(
    rf"CREATE (?:UNIQUE )?INDEX (?!CONCURRENTLY)\S+ ON (?:{'|'.join(LARGE)})\b", re.IGNORECASE
)
LAST_THAT_LOCKED = "2026_11_24_draws"


def test_later_migrations_make_indexes_of_large_tables_while_others_write() -> None:
    assert set(LARGE) <= set(metadata.tables)
    script = ScriptDirectory.from_config(alembic_config(""))
    for revision in script.walk_revisions():
        if revision.revision == LAST_THAT_LOCKED:
            break
        out = io.StringIO()
        config = alembic_config("postgresql+psycopg://")
        config.output_buffer = out
        command.upgrade(config, f"{revision.down_revision}:{revision.revision}", sql=True)
        found = LOCKS_A_LARGE_TABLE.findall(out.getvalue())
        assert not found, f"{revision.revision}: see CONTRIBUTING.md, {found}"


def test_what_locks_a_large_table_is_recognised(subtests) -> None:
    for sql, locks in [
        ("CREATE INDEX ix_luck ON jobs (seed)", True),
        ("CREATE UNIQUE INDEX ix_luck ON events (id)", True),
        ("CREATE INDEX CONCURRENTLY ix_luck ON jobs (seed)", False),
        ("CREATE INDEX ix_luck ON budgets (id)", False),
    ]:
        with subtests.test(sql=sql):
            assert bool(LOCKS_A_LARGE_TABLE.search(sql)) is locks


@pytest.mark.parametrize("idle_s", [0.0, 1000.0])
def test_a_connection_that_the_server_dropped_is_noticed(context, monkeypatch, idle_s) -> None:
    monkeypatch.setattr(database_module, "IDLE_S", idle_s)
    other = Database(context.store.database.url)

    def backend() -> int:
        with context.store.database.statement() as connection:
            return int(connection.exec_driver_sql("SELECT pg_backend_pid()").scalar_one())

    before = backend()
    with other.transaction() as connection:
        connection.exec_driver_sql(f"SELECT pg_terminate_backend({before}, 5000)")
    other.close()
    if idle_s:
        # A busy connection's break reaches its user, once.
        with pytest.raises(OperationalError):
            backend()
    assert backend() != before
