"""An API process with its database and broker, and no workers, for benchmarks."""

import os
import subprocess
import sys
import tempfile
from collections.abc import Collection, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import httpx
from support.servers.stacks import wait_until

from buildarena_backend.database.database import Database
from buildarena_cli.local.postgres import EmbeddedPostgres
from buildarena_cli.local.server import EmbeddedValkey, free_port


@dataclass(frozen=True, kw_only=True)
class Service:
    """An API process."""

    url: str
    pid: int
    database_url: str
    broker_pid: int


@contextmanager
def api_process() -> Iterator[tuple[str, int]]:
    """Runs one in a folder of its own; yields its URL and process id."""
    with api_service({}) as service:
        yield service.url, service.pid


@contextmanager
def api_service(settings: Mapping[str, str]) -> Iterator[Service]:
    """As api_process, with settings as environment variables."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        postgres = EmbeddedPostgres(folder / "pg", folder / "pg.log")
        stack.callback(postgres.stop, postgres.start())
        valkey = EmbeddedValkey(folder / "valkey", folder / "valkey.log")
        broker = valkey.start()
        stack.callback(valkey.stop, broker)
        database = Database(postgres.url)
        database.migrate()
        database.close()
        port = free_port()
        told = {"DATABASE_URL": postgres.url, "BROKER_URL": valkey.url}
        told |= {"DATA": str(folder / "data"), "PORT": str(port)}
        environment = (
            os.environ | {f"BUILDARENA_{name}": to for name, to in told.items()} | settings
        )
        with (folder / "api.log").open("wb") as log:
            words = [sys.executable, "-m", "buildarena_api"]
            process = subprocess.Popen(words, env=environment, stdout=log, stderr=log)
        stack.callback(process.wait)
        stack.callback(process.terminate)
        url = f"http://127.0.0.1:{port}"
        wait_until(lambda: answers(url), 60, "the API answers")
        yield Service(url=url, pid=process.pid, database_url=postgres.url, broker_pid=broker.pid)


def answers(url: str, statuses: Collection[int] = (200,)) -> bool:
    """Whether an API answers about its health, with one of these statuses."""
    try:
        return httpx.get(f"{url}/v1/health").status_code in statuses
    except httpx.TransportError:
        return False
