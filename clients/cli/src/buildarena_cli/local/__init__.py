"""Postgres and Valkey from PyPI wheels, run as children on loopback, data in a project folder."""

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
