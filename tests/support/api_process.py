"""An API process with its database and broker, and no workers, for benchmarks."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import httpx
from running import wait_until

from buildarena_cli.local import EmbeddedPostgres, EmbeddedValkey, free_port
from buildarena_store import Database


@contextmanager
def api_process() -> Iterator[tuple[str, int]]:
    """Runs one in a folder of its own; yields its URL and process id."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        postgres = EmbeddedPostgres(folder / "pg", folder / "pg.log")
        stack.callback(postgres.stop, postgres.start())
        valkey = EmbeddedValkey(folder / "valkey", folder / "valkey.log")
        stack.callback(valkey.stop, valkey.start())
        database = Database(postgres.url)
        database.migrate()
        database.close()
        port = free_port()
        environment = {
            **os.environ,
            "BUILDARENA_DATABASE_URL": postgres.url,
            "BUILDARENA_BROKER_URL": valkey.url,
            "BUILDARENA_DATA": str(folder / "data"),
            "BUILDARENA_PORT": str(port),
        }
        with (folder / "api.log").open("wb") as log:
            process = subprocess.Popen(
                [sys.executable, "-m", "buildarena_api"], env=environment, stdout=log, stderr=log
            )
        stack.callback(process.wait)
        stack.callback(process.terminate)
        url = f"http://127.0.0.1:{port}"
        wait_until(lambda: _answers(url), 60, "the API answers")
        yield url, process.pid


def _answers(url: str) -> bool:
    try:
        return httpx.get(f"{url}/v1/models").is_success
    except httpx.TransportError:
        return False
