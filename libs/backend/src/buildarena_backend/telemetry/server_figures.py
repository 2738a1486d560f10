"""Figures of the Postgres server, read as any login may: embedded, external, or past a pooler."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from sqlalchemy import Connection, text

HIDDEN: Final = "hidden"
"""Of connections of other logins, whose state only members of pg_read_all_stats see."""
CONNECTION_STATES: Final = (
    "active",
    "idle",
    "idle in transaction",
    "idle in transaction (aborted)",
    HIDDEN,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class ServerFigures:
    """The database, and the server that it is on.

    Attributes:
        size_bytes: The database's size on disk.
        connections: Connections to it, by their state; those that nothing is in are 0.
        server_connections: Connections to all databases of the server.
        server_connections_limit: How many the server takes.
        oldest_transaction_s: For how long the oldest open transaction has been open, of those whose
            start this login may see; 0 when none is.
        transaction_age: Transactions since the oldest row that is not frozen; the server stops
            before it is 2**31.
        committed: Transactions of the database that were committed, since its statistics began.
        rolled_back: Those that were undone.
        deadlocks: Those that were undone because they waited for each other.
        rows: Live rows by table, as the server estimates them.
        dead_rows: Rows by table that no transaction needs and that were not removed yet, likewise.
    """

    size_bytes: int
    connections: Mapping[str, int]
    server_connections: int
    server_connections_limit: int
    oldest_transaction_s: float
    transaction_age: int
    committed: int
    rolled_back: int
    deadlocks: int
    rows: Mapping[str, int]
    dead_rows: Mapping[str, int]


def read_server(connection: Connection) -> ServerFigures:
    """The figures of the server that a connection leads to."""
    database = connection.execute(_DATABASE).one()
    states = {row.state: int(row.connections) for row in connection.execute(_CONNECTIONS)}
    tables = connection.execute(_TABLES).all()
    return ServerFigures(
        size_bytes=database.size_bytes,
        connections=dict.fromkeys(CONNECTION_STATES, 0) | states,
        server_connections=database.server_connections,
        server_connections_limit=database.server_connections_limit,
        oldest_transaction_s=float(database.oldest_transaction_s),
        transaction_age=database.transaction_age,
        committed=database.xact_commit,
        rolled_back=database.xact_rollback,
        deadlocks=database.deadlocks,
        rows={row.relname: row.n_live_tup for row in tables},
        dead_rows={row.relname: row.n_dead_tup for row in tables},
    )


_DATABASE: Final = text(
    """
    SELECT pg_database_size(datid) AS size_bytes, xact_commit, xact_rollback, deadlocks,
        (SELECT sum(numbackends)::int FROM pg_stat_database) AS server_connections,
        current_setting('max_connections')::int AS server_connections_limit,
        (SELECT age(datfrozenxid) FROM pg_database WHERE oid = datid) AS transaction_age,
        (SELECT COALESCE(GREATEST(extract(epoch FROM clock_timestamp() - min(xact_start)), 0), 0)
            FROM pg_stat_activity AS other
            WHERE other.datid = mine.datid AND pid <> pg_backend_pid()) AS oldest_transaction_s
    FROM pg_stat_database AS mine WHERE datname = current_database()
    """
)
_CONNECTIONS: Final = text(
    f"""
    SELECT COALESCE(state, '{HIDDEN}') AS state, count(*) AS connections FROM pg_stat_activity
    WHERE datname = current_database()
        AND COALESCE(backend_type, 'client backend') = 'client backend'
    GROUP BY 1
    """  # noqa: S608 - made of our own words
)
_TABLES: Final = text(
    "SELECT relname, n_live_tup, n_dead_tup FROM pg_stat_user_tables WHERE schemaname = 'public'"
)
