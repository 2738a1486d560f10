"""Postgres: connections, tables, migrations, and what each role may do."""

# With the package come all tables: what refers to one finds it in the metadata.
from buildarena_backend.database import account_tables, tables

__all__ = ["account_tables", "tables"]
