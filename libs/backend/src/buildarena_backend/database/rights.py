"""Permissions in the database: one role for each kind of process, and the owner.

A role is a group without a password; each process signs in as its own member. The owner of the
tables migrates, makes backups and restores, and grants the rights below; no process is it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Final

from psycopg import sql
from sqlalchemy import Connection, text

_ACCOUNTS = ("api_keys", "names")
_SUBMITTED = (
    "budgets",
    "job_wants",
    "sweeps",
    "sweep_jobs",
    "tasks",
)
_WORK = ("artifacts", "attempts", "events", "job_artifacts", "jobs", "leases", "rollouts")
_SESSIONS = ("external_calls", "journal")
_FIGURES = ("board_changes", "workers")
_SCHEMA = ("alembic_version", "schema_compatibility")
_EVERY = (
    *_ACCOUNTS,
    *_SUBMITTED,
    *_WORK,
    *_SESSIONS,
    *_FIGURES,
    *_SCHEMA,
    "reservations",
    "verifications",
)
_SUSPENSION = ("suspended_at", "suspended_for")
_LOST = ("lost_cost_usd", "lost_requests")
_SPENT = ("spent_cost_usd", "spent_requests", "spent_tokens")


@dataclass(frozen=True, slots=True, kw_only=True)
class Role:
    """The rights of one kind of process.

    Attributes:
        changes: Tables whose rows it changes: all columns, or those that are named.
        sees: Readable columns of tables that it does not read.
    """

    meaning: str
    reads: tuple[str, ...]
    adds: tuple[str, ...] = ()
    changes: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    removes: tuple[str, ...] = ()
    sees: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


_WHOLE: tuple[str, ...] = ()
_REAPS: Final = ("job_artifacts", "leases", "reservations", "workers")
"""Tables in which every process removes rows, as its reaper may end leases."""
_WORKED: Final = dict.fromkeys(
    ("artifacts", "attempts", "job_artifacts", "jobs", "leases", "rollouts", "workers"),
    _WHOLE,
)

ROLES: Final[Mapping[str, Role]] = MappingProxyType(
    {
        "api": Role(
            meaning="The API: accounts, submissions, runners' trials, imports, boards.",
            reads=_EVERY,
            adds=tuple(name for name in _EVERY if name not in _SCHEMA),
            changes={
                name: _WHOLE for name in _EVERY if name not in {*_SCHEMA, "events", "journal"}
            },
            removes=(*_REAPS, "job_wants"),
        ),
        "construct": Role(
            meaning="Construct workers: sessions, their costs, verifications.",
            reads=tuple(name for name in _EVERY if name not in _ACCOUNTS),
            adds=(
                *("artifacts", "attempts", "events", "job_artifacts", "leases", "rollouts"),
                *_SESSIONS,
                *_FIGURES,
                *("reservations", "verifications"),
            ),
            changes={
                **_WORKED,
                "budgets": (*_LOST, *_SPENT),
                "reservations": _WHOLE,
                # A sweep whose budget is used up is stopped by the worker that finds it so.
                "sweeps": ("state",),
                "verifications": _WHOLE,
                # A verification that refutes a runner's trial suspends its key.
                "api_keys": _SUSPENSION,
            },
            removes=_REAPS,
            sees={"api_keys": ("id", *_SUSPENSION)},
        ),
        "simulate": Role(
            meaning="Simulation workers: trials and their scores.",
            reads=tuple(name for name in _EVERY if name not in {*_ACCOUNTS, "journal"}),
            adds=(
                *("artifacts", "attempts", "events", "job_artifacts", "leases"),
                # Trials in varied worlds are requested when the exact one is done.
                *("rollouts", "verifications", *_FIGURES),
            ),
            changes={**_WORKED, "budgets": _LOST, "verifications": _WHOLE},
            removes=_REAPS,
        ),
        "reader": Role(meaning="Reports and dumps: reads everything.", reads=_EVERY),
    }
)


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
    granted = [role for role in ROLES if group_of(role) in existing]
    for role in granted:
        group, rights = sql.Identifier(group_of(role)), ROLES[role]
        for kind in ("TABLES", "SEQUENCES"):
            run_with(connection, f"REVOKE ALL ON ALL {kind} IN SCHEMA public FROM {{}}", group)
        run_with(connection, "GRANT USAGE ON SCHEMA public TO {}", group)
        for right, tables in (
            ("SELECT", rights.reads),
            ("INSERT", rights.adds),
            ("DELETE", rights.removes),
        ):
            for table in tables:
                run_with(connection, f"GRANT {right} ON {{}} TO {{}}", sql.Identifier(table), group)
        for table, columns in rights.sees.items():
            right = f"SELECT ({', '.join(columns)})"
            run_with(connection, f"GRANT {right} ON {{}} TO {{}}", sql.Identifier(table), group)
        for table, columns in rights.changes.items():
            right = f"UPDATE ({', '.join(columns)})" if columns else "UPDATE"
            run_with(connection, f"GRANT {right} ON {{}} TO {{}}", sql.Identifier(table), group)
        if rights.adds:
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
