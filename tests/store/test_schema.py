from __future__ import annotations

import pytest
from alembic import command
from sqlalchemy.exc import OperationalError

from buildarena_pipeline.runtime.context import Context
from buildarena_store import Database, SchemaVersionError
from buildarena_store import database as database_module
from buildarena_store.database import alembic_config, expected_schema


def test_the_migrations_make_the_tables_that_the_code_knows(context: Context) -> None:
    command.check(alembic_config(context.store.database.url))


def test_another_schema_is_refused_with_advice(database_url: str) -> None:
    database = Database(database_url)
    database.require_schema()
    with database.transaction() as connection:
        connection.exec_driver_sql("UPDATE alembic_version SET version_num = 'older'")
    try:
        with pytest.raises(SchemaVersionError, match=r"schema older.*buildarena migrate"):
            database.require_schema()
    finally:
        with database.transaction() as connection:
            connection.exec_driver_sql(
                f"UPDATE alembic_version SET version_num = '{expected_schema()}'"
            )
        database.close()


@pytest.mark.parametrize("idle_s", [0.0, 1000.0])
def test_a_connection_that_the_server_dropped_is_noticed(
    context: Context, monkeypatch: pytest.MonkeyPatch, idle_s: float
) -> None:
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
