"""Runs the chain against the database that the caller named."""

from alembic import context
from sqlalchemy import Connection, NullPool, create_engine, inspect, text

from buildarena_store.tables import metadata


def note_compatibility(connection: Connection) -> None:
    """Notes since which schema programs work: the last that a migration broke with, if any."""
    if not inspect(connection).has_table("schema_compatibility"):
        return
    since = next(
        revision.revision
        for revision in context.script.walk_revisions()
        if getattr(revision.module, "BREAKING", False)
    )
    connection.execute(text("DELETE FROM schema_compatibility"))
    connection.execute(text("INSERT INTO schema_compatibility VALUES (:since)"), {"since": since})
    connection.commit()


def run() -> None:
    """Applies the revisions in one transaction each, or prints the SQL when offline."""
    url = context.config.attributes["url"]
    if context.is_offline_mode():
        context.configure(url=url, target_metadata=metadata, literal_binds=True)
        with context.begin_transaction():
            context.run_migrations()
        return
    with create_engine(url, poolclass=NullPool).connect() as connection:
        context.configure(
            connection=connection, target_metadata=metadata, transaction_per_migration=True
        )
        with context.begin_transaction():
            context.run_migrations()
        note_compatibility(connection)


run()
