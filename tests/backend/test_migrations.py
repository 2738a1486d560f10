from collections.abc import Iterator
from contextlib import contextmanager
from hashlib import sha256

import pytest
from alembic import command
from alembic.script import ScriptDirectory
from support.documents.kept_schema import FILE, schema_text

from buildarena_backend.database.database import SCHEMA, Database
from buildarena_backend.database.migrations import TRIGGERS, alembic_config, known_schemas
from buildarena_backend.errors import SchemaVersionError


def fingerprint() -> str:
    """Of all that the first revision makes, with its number."""
    made = FILE.read_text(encoding="utf-8") + TRIGGERS.read_text(encoding="utf-8")
    return f"0001_{sha256(made.encode()).hexdigest()[:8]}"


def test_the_first_revision_has_the_name_of_what_it_makes() -> None:
    """Until 1.0.0, give `SCHEMA` and the revision this name; then both files stay as they are."""
    assert fingerprint() in known_schemas()
    assert ScriptDirectory.from_config(alembic_config("")).get_current_head() == SCHEMA


@pytest.mark.skipif(len(known_schemas()) > 1, reason="later revisions have changed the tables")
def test_the_only_revision_makes_what_the_code_knows() -> None:
    """Until 1.0.0, `make generate NAME=schema`; from then on, add a revision."""
    assert FILE.read_text(encoding="utf-8") == schema_text()


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
