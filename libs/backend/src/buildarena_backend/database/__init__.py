"""Postgres: connections, tables, migrations, and the roles' rights."""

# With the package come all tables: what refers to one finds it in the metadata.
from buildarena_backend.database import account_tables, tables

__all__ = ["account_tables", "tables"]
