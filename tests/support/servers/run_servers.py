"""Postgres and Valkey of a test run: started when a test first asks for them, by whichever worker.

The process that pytest was started as owns them, so that they outlast any worker; workers ask it
over a socket. A run whose tests need none starts none, and imports nothing of the services.
"""

from __future__ import annotations

import os
import shutil
import tempfile
import threading
from contextlib import ExitStack, suppress
from multiprocessing.connection import Client, Listener
from pathlib import Path
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from buildarena_cli.local.postgres import EmbeddedPostgres
    from buildarena_cli.local.server import EmbeddedValkey

ADDRESS: Final = "TEST_SERVERS_SOCKET"
"""Variable with the path of the socket."""
TEMPLATE: Final = "buildarena_template"
"""Name of the migrated, empty database that those of workers are copies of."""


class RunServers:
    """Answers each worker that asks with the two URLs; stops what it started in the end."""

    def __init__(self) -> None:
        self._stack = ExitStack()
        self._folder = Path(tempfile.mkdtemp(prefix="buildarena-tests-"))
        self._stack.callback(shutil.rmtree, self._folder, ignore_errors=True)
        self._listener = Listener(str(self._folder / "socket"), "AF_UNIX")
        os.environ[ADDRESS] = str(self._folder / "socket")
        self._thread = threading.Thread(target=self._answer, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stops the servers, if any were started, and removes their folder."""
        with Client(os.environ.pop(ADDRESS), "AF_UNIX") as connection:
            connection.send("end")
        self._thread.join()
        self._listener.close()
        self._stack.close()

    def _answer(self) -> None:
        urls: tuple[str, str] | Exception | None = None
        while True:
            with self._listener.accept() as connection, suppress(EOFError, OSError):
                if connection.recv() == "end":
                    return
                if urls is None:
                    try:
                        urls = self._start()
                    except Exception as error:  # noqa: BLE001 - raised where it was asked for
                        urls = RuntimeError(f"the servers of the tests did not start: {error}")
                connection.send(urls)

    def _start(self) -> tuple[str, str]:
        from buildarena_backend.database.database import Database
        from buildarena_cli.local.postgres import EmbeddedPostgres
        from buildarena_cli.local.server import EmbeddedValkey

        postgres = EmbeddedPostgres(self._folder / "pg", self._folder / "pg.log", durable=False)
        self._run(postgres)
        valkey = EmbeddedValkey(self._folder / "valkey", self._folder / "valkey.log")
        self._run(valkey)
        execute(postgres.url, f"CREATE DATABASE {TEMPLATE}")
        template = Database(postgres.url.replace("/postgres", f"/{TEMPLATE}"))
        template.migrate()
        template.close()
        return postgres.url, valkey.url

    def _run(self, server: EmbeddedPostgres | EmbeddedValkey) -> None:
        self._stack.callback(server.stop, server.start())


def server_urls() -> tuple[str, str]:
    """The URLs of Postgres and Valkey, which are started if they are not.

    Raises:
        RuntimeError: They did not start.
    """
    with Client(os.environ[ADDRESS], "AF_UNIX") as connection:
        connection.send("start")
        urls = connection.recv()
    if isinstance(urls, Exception):
        raise urls
    return urls


def execute(url: str, statement: str) -> None:
    """Executes a statement outside any transaction."""
    from sqlalchemy import create_engine, text

    engine = create_engine(
        url.replace("postgresql://", "postgresql+psycopg://"), isolation_level="AUTOCOMMIT"
    )
    with engine.connect() as connection:
        connection.execute(text(statement))
    engine.dispose()
