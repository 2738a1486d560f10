"""Postgres and Valkey from PyPI wheels, run as children on loopback, data in a project folder."""

from buildarena_pipeline.embedded.postgres import EmbeddedPostgres
from buildarena_pipeline.embedded.server import EmbeddedServer, free_port
from buildarena_pipeline.embedded.supervisor import ManagedProcess, Supervisor
from buildarena_pipeline.embedded.valkey import EmbeddedValkey

__all__ = [
    "EmbeddedPostgres",
    "EmbeddedServer",
    "EmbeddedValkey",
    "ManagedProcess",
    "Supervisor",
    "free_port",
]
