"""Roles of the database and the logins of processes; their rights are in `rights`."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from typing import Any, Final

from psycopg import sql
from sqlalchemy import Connection, make_url, text
from sqlalchemy.exc import IntegrityError, ProgrammingError

from buildarena_backend.database.database import MIGRATION_LOCK, Database
from buildarena_backend.database.rights import ROLES, group_of
from buildarena_backend.database.rights import run_with as _run
from buildarena_backend.errors import StoreError

OWNER: Final = "owner"
"""The role that migrates and grants: it owns the tables, and no process is it."""
_PLAIN: Final = "NOSUPERUSER NOCREATEDB NOCREATEROLE NOREPLICATION NOBYPASSRLS"
_EXISTS: Final = text("SELECT 1 FROM pg_roles WHERE rolname = :name")


class RoleError(StoreError):
    """A role or a login that can't be used; the message has the reason."""


def make_roles(database: Database, logins: Mapping[str, str]) -> None:
    """Make the roles, and a login of each that is named; safe to repeat, with new passwords too.

    A login has no right but its role's. The owner's gets database, schema and all tables, so that
    an older installation whose tables are a superuser's is taken over.

    Args:
        database: Connected as a role that may create roles and owns all tables.
        logins: By role or `OWNER`, the URL that the process signs in with.

    Raises:
        RoleError: A name is not a role, or a URL has no user or password.
    """
    accounts = {role: _account(role, url) for role, url in logins.items()}
    names = [name for name, _ in accounts.values()]
    if len(set(names)) < len(names):
        raise RoleError(f"each role needs its own login; there are {', '.join(names)}")
    with database.transaction() as connection:
        connection.execute(text("SELECT pg_advisory_xact_lock(:key)"), {"key": MIGRATION_LOCK})
        for role in ROLES:
            _make(connection, group_of(role), "NOLOGIN")
        for role, (name, password) in accounts.items():
            _make(connection, name, "LOGIN")
            _set_password(connection, name, password)
            if role != OWNER:
                _leave_other_groups(connection, name, group_of(role))
                group = sql.Identifier(group_of(role))
                _run(connection, "GRANT {} TO {}", group, sql.Identifier(name))
        base = sql.Identifier(str(connection.execute(text("SELECT current_database()")).scalar()))
        _run(connection, "REVOKE ALL ON DATABASE {} FROM PUBLIC", base)
        _run(connection, "REVOKE CREATE ON SCHEMA public FROM PUBLIC")
        for role in ROLES:
            _run(connection, "GRANT CONNECT ON DATABASE {} TO {}", base, _group(role))
    if OWNER in accounts:
        _own(database, accounts[OWNER][0])


def _group(role: str) -> sql.Identifier:
    return sql.Identifier(group_of(role))


def _account(role: str, url: str) -> tuple[str, str]:
    if role not in {*ROLES, OWNER}:
        raise RoleError(f"no role {role!r}; there are {', '.join([*ROLES, OWNER])}")
    named = make_url(url)
    if not named.username or not named.password:
        raise RoleError(f"the URL of {role} has no user and password")
    return named.username, named.password


def _make(connection: Connection, name: str, login: str) -> None:
    parameters = {"name": name}
    if connection.execute(_EXISTS, parameters).first():
        plain = text(
            "SELECT NOT (rolsuper OR rolcreaterole OR rolcreatedb OR rolreplication "
            "OR rolbypassrls) FROM pg_roles WHERE rolname = :name"
        )
        if not connection.execute(plain, parameters).scalar():
            raise RoleError(f"{name} is a superuser or may do more than a process should")
        return
    # Roles are the server's: another database's setup may have made them first.
    with suppress(IntegrityError, ProgrammingError), connection.begin_nested():
        _run(connection, f"CREATE ROLE {{}} {login} {_PLAIN}", sql.Identifier(name))
        return
    if not connection.execute(_EXISTS, parameters).first():
        raise RoleError(f"{name} can't be made by this account")


def _set_password(connection: Connection, name: str, password: str) -> None:
    """Send a verifier, so that no log of the server has the password."""
    driver: Any = connection.connection.driver_connection
    verifier = driver.pgconn.encrypt_password(
        password.encode(), name.encode(), b"scram-sha-256"
    ).decode()
    _run(
        connection,
        "ALTER ROLE {} LOGIN PASSWORD {}",
        sql.Identifier(name),
        sql.Literal(verifier),
    )


def _leave_other_groups(connection: Connection, name: str, group: str) -> None:
    memberships = text(
        "SELECT parent.rolname FROM pg_auth_members JOIN pg_roles AS parent ON parent.oid = roleid "
        "JOIN pg_roles AS child ON child.oid = member WHERE child.rolname = :name"
    )
    for parent in connection.execute(memberships, {"name": name}).scalars().all():
        if parent != group:
            _run(connection, "REVOKE {} FROM {}", sql.Identifier(parent), sql.Identifier(name))


def _own(database: Database, name: str) -> None:
    """Make the owner own database, schema and everything in it.

    One after another: a process that holds one table's lock and waits for the next would stop
    processes that work with both in the other order.
    """
    statements = database.all_values(text(_NOT_OWNED), {"name": name})
    for statement in statements:
        with database.statement() as connection:
            _run(connection, statement + " OWNER TO {}", sql.Identifier(name))


_NOT_OWNED: Final = """
    SELECT format('ALTER DATABASE %I', datname) FROM pg_database
    WHERE datname = current_database() AND pg_get_userbyid(datdba) <> :name
    UNION ALL
    SELECT format('ALTER SCHEMA %I', nspname) FROM pg_namespace
    WHERE nspname = 'public' AND pg_get_userbyid(nspowner) <> :name
    UNION ALL
    SELECT format('ALTER %s public.%I', CASE relkind WHEN 'S' THEN 'SEQUENCE'
        WHEN 'v' THEN 'VIEW' ELSE 'TABLE' END, relname)
    FROM pg_class WHERE relnamespace = 'public'::regnamespace AND relkind IN ('r', 'p', 'v', 'S')
        AND pg_get_userbyid(relowner) <> :name
        AND NOT EXISTS (SELECT FROM pg_depend WHERE classid = 'pg_class'::regclass
            AND objid = pg_class.oid AND deptype IN ('a', 'i') AND relkind = 'S')
    UNION ALL
    SELECT format('ALTER FUNCTION public.%I(%s)', proname, pg_get_function_identity_arguments(oid))
    FROM pg_proc WHERE pronamespace = 'public'::regnamespace
        AND pg_get_userbyid(proowner) <> :name
"""
