"""The chain of migrations, by Alembic."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from alembic import command
from alembic.config import Config
from alembic.script import ScriptDirectory
from psycopg.errors import DeadlockDetected
from sqlalchemy.exc import OperationalError

MIGRATIONS: Final = Path(__file__).parents[1] / "migrations"
"""The folder at the top of the repository, by a link that wheels follow."""
TRIGGERS: Final = MIGRATIONS / "sql" / "triggers.sql"
TRIES: Final = 5


def alembic_config(url: str) -> Config:
    """Return the Alembic settings for a database, without any ini file."""
    config = Config()
    config.set_main_option("script_location", str(MIGRATIONS))
    config.attributes["url"] = url
    return config


def migrate_to_newest(url: str) -> None:
    """Bring a database to the newest revision.

    Processes that work meanwhile lock its tables in other orders: a revision that met one
    halfway is undone by the server, and begun again.
    """
    for tries_left in reversed(range(TRIES)):
        try:
            command.upgrade(alembic_config(url), "head")
            break
        except OperationalError as error:
            if not tries_left or not isinstance(error.orig, DeadlockDetected):
                raise


def known_schemas() -> frozenset[str]:
    """Return all revisions from which this program can migrate a database to the newest."""
    script = ScriptDirectory.from_config(alembic_config(""))
    return frozenset(revision.revision for revision in script.walk_revisions())
