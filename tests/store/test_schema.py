from __future__ import annotations

import pytest
from alembic import command

from buildarena_pipeline.context import Context
from buildarena_store import Database, SchemaVersionError
from buildarena_store.database import alembic_config, expected_schema


def test_the_migrations_make_the_tables_that_the_code_knows(context: Context) -> None:
    command.check(alembic_config(context.database.url))


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
