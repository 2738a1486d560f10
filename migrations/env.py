"""Runs the chain against the database that the caller named."""

from alembic import context
from sqlalchemy import Connection, NullPool, create_engine, text

from buildarena_backend.database.tables import metadata


def note_compatibility(connection: Connection) -> None:
    """Notes since which schema programs work: the last that a migration broke with, if any."""
    since = next(
        revision.revision
        for revision in context.script.walk_revisions()
        if getattr(revision.module, "BREAKING", False)
    )
    connection.execute(text("DELETE FROM schema_compatibility"))
    connection.execute(text("INSERT INTO schema_compatibility VALUES (:since)"), {"since": since})
    connection.commit()


def run() -> None:
    """Applies the revisions in one transaction each."""
    url = context.config.attributes["url"]
    with create_engine(url, poolclass=NullPool).connect() as connection:
        context.configure(
            connection=connection, target_metadata=metadata, transaction_per_migration=True
        )
        with context.begin_transaction():
            context.run_migrations()
        note_compatibility(connection)


run()
