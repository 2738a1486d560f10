"""Postgres and Valkey from PyPI wheels, run as children on loopback, data in a project folder."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from buildarena_cli.local.postgres import EmbeddedPostgres
    from buildarena_cli.local.server import EmbeddedServer, free_port
    from buildarena_cli.local.supervisor import ManagedProcess, Supervisor
    from buildarena_cli.local.valkey import EmbeddedValkey

__all__ = [
    "EmbeddedPostgres",
    "EmbeddedServer",
    "EmbeddedValkey",
    "ManagedProcess",
    "Supervisor",
    "free_port",
]
_MODULES = {
    "EmbeddedPostgres": "postgres",
    "EmbeddedServer": "server",
    "EmbeddedValkey": "valkey",
    "ManagedProcess": "supervisor",
    "Supervisor": "supervisor",
    "free_port": "server",
}


def __getattr__(name: str) -> Any:
    # Loaded when used: `status` and `logs` need none of the servers' libraries.
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
