"""Rights of the roles in the database, as `migrations/sql/roles.sql` states them.

A role is a group without a password; each process signs in as its own member. The owner of the
tables migrates, makes backups and restores, and grants these rights; no process is it.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, Final

from psycopg import sql
from sqlalchemy import Connection, text

ROLES: Final = ("api", "construct", "simulate", "reader")
RIGHTS: Final = Path(__file__).parents[1] / "migrations" / "sql" / "roles.sql"


def group_of(role: str) -> str:
    """Return the name of a role in the database."""
    return f"buildarena_{role}"


def grant_rights(connection: Connection) -> list[str]:
    """Give each role that the server has exactly its rights on this database's tables.

    Args:
        connection: The owner's, in a transaction.

    Returns:
        The roles.
    """
    existing = set(connection.execute(text("SELECT rolname FROM pg_roles")).scalars())
    _, *sections = re.split("-- role (.+):", RIGHTS.read_text(encoding="utf-8"))
    rights = dict(zip(sections[::2], sections[1::2], strict=True))
    granted = [role for role in ROLES if group_of(role) in existing]
    for role in granted:
        group = sql.Identifier(group_of(role))
        for kind in ("TABLES", "SEQUENCES"):
            run_with(connection, f"REVOKE ALL ON ALL {kind} IN SCHEMA public FROM {{}}", group)
        run_with(connection, "GRANT USAGE ON SCHEMA public TO {}", group)
        connection.connection.cursor().execute("--" + rights[role])
        if "INSERT" in rights[role]:
            run_with(connection, "GRANT USAGE ON ALL SEQUENCES IN SCHEMA public TO {}", group)
    return granted


def run_with(connection: Connection, statement: str, *parts: sql.Composable) -> None:
    """Run a statement with braces for names and literals.

    Args:
        parts: Names and literals for its braces, in order.
    """
    driver: Any = connection.connection.driver_connection
    composed = sql.SQL(statement).format(*parts).as_string(driver)
    connection.exec_driver_sql(composed.replace("%", "%%"))
