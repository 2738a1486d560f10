"""Writes the first revision's statements again: `make generate NAME=schema`.

Run it after an intended change of tables, until 1.0.0: from then on the file stays as it is.
"""

from sqlalchemy.dialects.postgresql import dialect
from sqlalchemy.schema import CreateIndex, CreateTable

from buildarena_backend.database.migrations import TRIGGERS
from buildarena_backend.database.tables import metadata

FILE = TRIGGERS.with_name("0001_tables.sql")


def schema_statements() -> list[str]:
    """What makes the tables that the code knows, and their indexes."""
    tables = metadata.sorted_tables
    made = [str(CreateTable(table).compile(dialect=dialect())) for table in tables]
    indexes = [index for table in tables for index in table.indexes]
    return made + sorted(str(CreateIndex(index).compile(dialect=dialect())) for index in indexes)


def schema_text() -> str:
    """These statements as they stand in the file."""
    lines = ";\n".join(statement.strip() for statement in schema_statements()).splitlines()
    return "\n".join(line.rstrip().expandtabs(4) for line in lines) + ";\n"


if __name__ == "__main__":
    FILE.write_text(schema_text(), encoding="utf-8")
