"""Runs the chain against the database that the caller named."""

from alembic import context
from sqlalchemy import create_engine

from buildarena_store.tables import metadata


def run() -> None:
    """Applies the revisions in one transaction each, or prints the SQL when offline."""
    url = context.config.attributes["url"]
    if context.is_offline_mode():
        context.configure(url=url, target_metadata=metadata, literal_binds=True)
        with context.begin_transaction():
            context.run_migrations()
        return
    engine = create_engine(url)
    with engine.connect() as connection:
        context.configure(
            connection=connection, target_metadata=metadata, transaction_per_migration=True
        )
        with context.begin_transaction():
            context.run_migrations()
    engine.dispose()


run()
