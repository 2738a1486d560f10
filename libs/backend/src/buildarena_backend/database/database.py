"""The connection to Postgres and the schema's version."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import psycopg
from sqlalchemy import (
    Connection,
    Engine,
    Executable,
    Row,
    create_engine,
    event,
    inspect,
    make_url,
    text,
)
from sqlalchemy.engine.interfaces import DBAPIConnection
from sqlalchemy.exc import DisconnectionError, OperationalError
from sqlalchemy.exc import TimeoutError as PoolTimeoutError
from sqlalchemy.pool import ConnectionPoolEntry

from buildarena_backend.database.rights import grant_rights
from buildarena_backend.errors import SchemaVersionError

Values = Mapping[str, Any] | None
IDLE_S = 2.0
GIVEN_UP = {
    "keepalives_idle": 5,
    "keepalives_interval": 3,
    "keepalives_count": 3,
    "tcp_user_timeout": 10_000,
}
"""Limits after which this end closes a connection to a silent server (libpq's names)."""
GIVEN_UP_THERE = {
    "tcp_keepalives_idle": 10,
    "tcp_keepalives_interval": 5,
    "tcp_keepalives_count": 3,
    "tcp_user_timeout": 20_000,
}
"""The server's limits: a lost machine holds the locks of its transactions until then."""
SCHEMA = "0001_cf3923d3"
"""The newest revision of the migrations: what this code was written for. Said here, so that a
process that starts need not read them all."""
AS_THEY_ARE = {"bytes": "as they are"}
"""Options of a statement whose rows have many bytes, each of which is two as text."""
MIGRATION_LOCK = 0x6275696C64  # "build": two processes that migrate at once take turns
LOCK_PAUSE_S = 0.2


def _unknown_schema(schema: str) -> str:
    return (
        f"the database has schema {schema}, which this program ({SCHEMA}) does not know: it is of "
        "a release candidate or of a later version, and was left as it is; use that version, or an "
        "empty database (another --data)"
    )


def ping_after_idling(engine: Engine) -> None:
    """Have connections that were idle for a while tested before they are used again.

    A server that was restarted is noticed so, at the cost of a round trip for rare uses only; a
    busy connection's break shows itself as an OperationalError, which all callers expect.
    """

    @event.listens_for(engine, "checkin")
    def _note(_: object, record: ConnectionPoolEntry) -> None:
        record.info["used_at"] = time.monotonic()

    @event.listens_for(engine, "checkout")
    def _try(connection: DBAPIConnection, record: ConnectionPoolEntry, _: object) -> None:
        if time.monotonic() - record.info.get("used_at", math.inf) <= IDLE_S:
            return
        try:
            engine.dialect.do_ping(connection)
        except engine.dialect.loaded_dbapi.Error as error:
            raise DisconnectionError from error


def send_bytes_as_they_are(engine: Engine) -> None:
    """Receive rows of statements with the options `AS_THEY_ARE` in the database's binary form."""

    @event.listens_for(engine, "before_cursor_execute")
    def choose(
        _connection: Connection, cursor: Any, _text: str, _values: Any, context: Any, _many: bool
    ) -> None:
        if "bytes" in context.execution_options:
            cursor.format = psycopg.pq.Format.BINARY


def greet_servers(engine: Engine) -> None:
    """Set the server's limits for dead connections, and detect poolers.

    A pooler that hands out servers by the transaction, such as PgBouncer, invents the process id
    that a connection begins with, takes no settings with it, and gives the next statement to
    another server: prepared statements, which belong to one server, are left out there.
    """
    # The URL's own options take precedence.
    ours = {} if "options" in engine.url.query else GIVEN_UP_THERE
    limits = "".join(f", set_config('{name}', '{value}', false)" for name, value in ours.items())

    @event.listens_for(engine, "connect")
    def _greet(connection: psycopg.Connection, _: ConnectionPoolEntry) -> None:
        with connection.cursor() as cursor:
            cursor.execute(f"SELECT pg_backend_pid(){limits}".encode())
            served_by, *_limits = cursor.fetchone() or (None,)
        connection.commit()
        if served_by != connection.info.backend_pid:
            connection.prepare_threshold = None


def _connect_args(url: str, name: str) -> dict[str, str | int]:
    """Return the connection arguments; those in the URL take precedence."""
    asked = make_url(url).query
    ours: dict[str, str | int] = {"connect_timeout": 5, "application_name": name, **GIVEN_UP}
    return {name: value for name, value in ours.items() if name not in asked}


class NoConnectionError(PoolTimeoutError, OperationalError):
    """No connection came free in time, as those there are wait for a server that does not answer.

    Code that works through outages treats it as one, although SQLAlchemy distinguishes the two.
    """


class Database:
    """A pool of connections to one Postgres database.

    Args:
        url: ``postgresql://user:password@host:port/name``.
        pool_size: Connections kept open.
        overflow: Further connections that may open for a moment; by default as many again.
        name: ``application_name`` of the connections in Postgres.
    """

    def __init__(
        self,
        url: str,
        *,
        pool_size: int = 5,
        pool_timeout_s: float = 30.0,
        overflow: int | None = None,
        name: str = "buildarena",
    ) -> None:
        self.url = url.replace("postgresql://", "postgresql+psycopg://", 1)
        self.engine: Engine = create_engine(
            self.url,
            pool_size=pool_size,
            max_overflow=pool_size if overflow is None else overflow,
            pool_timeout=pool_timeout_s,
            pool_recycle=1800,
            connect_args=_connect_args(self.url, name),
        )
        greet_servers(self.engine)
        ping_after_idling(self.engine)
        send_bytes_as_they_are(self.engine)
        self._autocommit = self.engine.execution_options(isolation_level="AUTOCOMMIT")

    @contextmanager
    def transaction(self) -> Iterator[Connection]:
        """Yield a connection whose work is committed at the end, or undone after an error."""
        with self._connect(self.engine) as connection, connection.begin():
            yield connection

    @contextmanager
    def statement(self) -> Iterator[Connection]:
        """Yield a connection for one statement, which is a transaction by itself.

        It saves the round trips of BEGIN and COMMIT for single statements.
        """
        with self._connect(self._autocommit) as connection:
            yield connection

    def all_rows(self, query: Executable, values: Values = None) -> Sequence[Row[Any]]:
        """Return the rows of one statement, which is committed at once."""
        with self.statement() as connection:
            return connection.execute(query, values).all()

    def first_row(self, query: Executable, values: Values = None) -> Row[Any] | None:
        """Return the first row of one statement, which is committed at once."""
        with self.statement() as connection:
            return connection.execute(query, values).first()

    def all_values(self, query: Executable, values: Values = None) -> Sequence[Any]:
        """Return the first value of each row of one statement, which is committed at once."""
        return [row[0] for row in self.all_rows(query, values)]

    def first_value(self, query: Executable, values: Values = None) -> Any:
        """Return the first value of the first row of one statement; None without a row."""
        row = self.first_row(query, values)
        return None if row is None else row[0]

    def run(self, statement: Executable, values: Values = None) -> int:
        """Carry out one statement, commit it at once, and return how many rows it changed."""
        with self.statement() as connection:
            return connection.execute(statement, values).rowcount

    @staticmethod
    def _connect(engine: Engine) -> Connection:
        try:
            return engine.connect()
        except PoolTimeoutError as error:
            raise NoConnectionError(None, None, error) from error

    def migrate(self) -> str:
        """Bring the schema to the newest revision, and give roles their rights on its tables.

        It is safe to run from several processes at once.

        Returns:
            The revision the database has now.

        Raises:
            SchemaVersionError: It is of a release candidate or of a later version; it is left as
                it is.
        """
        from buildarena_backend.database.migrations import known_schemas, migrate_to_newest

        # Indexes that are made while others write wait for every transaction, so the holder of the
        # lock and those that wait for it are in none.
        with self.engine.connect().execution_options(isolation_level="AUTOCOMMIT") as connection:
            lock = text("SELECT pg_try_advisory_lock(:key)")
            while not connection.execute(lock, {"key": MIGRATION_LOCK}).scalar():
                time.sleep(LOCK_PAUSE_S)
            try:
                if (schema := self.schema()) is not None and schema not in known_schemas():
                    raise SchemaVersionError(_unknown_schema(schema))
                migrate_to_newest(self.url)
                with self.engine.begin() as owner:
                    grant_rights(owner)
            finally:
                connection.execute(text("SELECT pg_advisory_unlock(:key)"), {"key": MIGRATION_LOCK})
        return SCHEMA

    def schema(self) -> str | None:
        """Return the database's revision, or None when it was never migrated."""
        with self.engine.connect() as connection:
            if not inspect(connection).has_table("alembic_version"):
                return None
            row = connection.execute(text("SELECT version_num FROM alembic_version")).first()
            return None if row is None else str(row[0])

    def require_schema(self) -> None:
        """Check that the database fits this code: its own schema, or a later one that only adds.

        Raises:
            SchemaVersionError: It does not; the message has the remedy.
        """
        schema = self.schema()
        if schema == SCHEMA:
            return
        # Alembic is loaded by those who migrate, and where something is to be explained.
        from buildarena_backend.database.migrations import known_schemas

        known_ids = known_schemas()
        if schema is not None and schema not in known_ids:
            if self._compatible_since() in known_ids:
                return
            raise SchemaVersionError(_unknown_schema(schema))
        raise SchemaVersionError(
            f"the database has schema {schema or 'none'}, this program needs {SCHEMA}: "
            "run `buildarena admin migrate`"
        )

    def _compatible_since(self) -> str | None:
        with self.engine.connect() as connection:
            if not inspect(connection).has_table("schema_compatibility"):
                return None
            return connection.execute(text("SELECT since FROM schema_compatibility")).scalar()

    def close(self) -> None:
        """Close all connections."""
        self.engine.dispose()
