from collections.abc import Iterator
from contextlib import contextmanager
from hashlib import sha256

import pytest
from alembic import command
from sqlalchemy.dialects.postgresql import dialect
from sqlalchemy.schema import CreateIndex, CreateTable

from buildarena_backend.database.database import SCHEMA, Database
from buildarena_backend.database.migrations import TRIGGERS, alembic_config, known_schemas
from buildarena_backend.database.tables import metadata
from buildarena_backend.errors import SchemaVersionError


def fingerprint() -> str:
    """Of all that the first revision makes, with its number."""
    tables = metadata.sorted_tables
    made = [str(CreateTable(table).compile(dialect=dialect())) for table in tables]
    indexes = [index for table in tables for index in table.indexes]
    made += sorted(str(CreateIndex(index).compile(dialect=dialect())) for index in indexes)
    made.append(TRIGGERS.read_text(encoding="utf-8"))
    return f"0001_{sha256(''.join(made).encode()).hexdigest()[:8]}"


def test_until_1_0_0_the_schema_has_one_revision_named_by_what_it_makes() -> None:
    """Give `SCHEMA` and the revision this name when tables or triggers change."""
    assert known_schemas() == {SCHEMA} == {fingerprint()}


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


def test_a_release_candidates_schema_is_refused_and_left_as_it_is(database) -> None:
    database.require_schema()
    with of_schema(database, "2026_11_27_what_goes", since="2026_11_27_what_goes"):
        for refused in (database.require_schema, database.migrate):
            with pytest.raises(SchemaVersionError, match="of a release candidate or of a later"):
                refused()
        assert database.schema() == "2026_11_27_what_goes"


def test_a_later_schema_that_only_adds_serves_the_programs_before(database) -> None:
    with of_schema(database, "2099_01_01_flight"):
        database.require_schema()
