"""The commands that run the service on this machine: up, demo, migrate."""

from __future__ import annotations

import os
import shutil
import signal
import sys
import threading
from pathlib import Path
from typing import Annotated, Any

import typer
from pydantic import ValidationError

from buildarena_cli.client import Client
from buildarena_cli.errors import CommandError
from buildarena_cli.local.stack import Stack
from buildarena_cli.output import console, leaderboard_tables
from buildarena_cli.progress import exit_code, watch_sweep
from buildarena_pipeline.catalog.tracks import SIMULATORS
from buildarena_pipeline.runtime.settings import Settings
from buildarena_store import Database
from buildarena_store.states import CONSTRUCT_QUEUE, simulate_queue

DEMO_SWEEP = {
    "name": "demo",
    "tasks": [
        *("transport-1", "transport-2", "transport-3"),
        *("support-1", "support-2", "support-3"),
        *("lift-1", "lift-2", "lift-3"),
    ],
    "models": ["builtin/expert", "builtin/random", "builtin/idle"],
    "seeds": [0, 1, 2, 3],
}
MEBIBYTE = 1024 * 1024

DataOption = Annotated[Path | None, typer.Option("--data", help="Folder of databases and logs.")]
PortOption = Annotated[int | None, typer.Option("--port", help="Port of the API.")]


def up(
    data: DataOption = None,
    port: PortOption = None,
    *,
    keys: Annotated[
        bool, typer.Option("--keys", help="Ask for API keys; the operator's is kept in DATA.")
    ] = False,
) -> None:
    """Start the whole service on this machine and keep it up until Ctrl-C."""
    settings = _settings(data, port, require_keys=keys or None)
    stopping = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stopping.set())
    _tell_simulators()
    with Stack(settings, tell=_tell) as stack:
        console.print(f"API {stack.url}  ·  docs {stack.url}/docs  ·  logs {stack.logs}")
        console.print("Ctrl-C stops it.")
        while not stopping.wait(0.5):
            stack.require_running()
        _tell("stopping")


def demo(data: DataOption = None, port: PortOption = None) -> None:
    """Start everything, run one small sweep, show the leaderboard, and stop everything."""
    settings = _settings(data, port)
    settings = settings.model_copy(update={"data": settings.data / "demo"})
    _interrupt_on_terminate()
    if not (settings.data / "lock").exists() or _unlocked(settings):
        shutil.rmtree(settings.data, ignore_errors=True)
    _tell_simulators()
    with Stack(settings, tell=_tell) as stack:
        client = Client(stack.url, key=stack.admin_key)
        sweep_id = client.post("/v1/sweeps", DEMO_SWEEP)["id"]
        sweep = watch_sweep(client, sweep_id)
        stack.require_running()
        for table in leaderboard_tables(client.get("/v1/leaderboard")):
            console.print(table)
        client.close()
    peak = stack.peak_memory_bytes / MEBIBYTE
    console.print(f"Peak memory of all processes: {peak:,.0f} MiB.")
    console.print(f"Results are kept in {settings.data.absolute()}.")
    console.print(
        f"See them again with `buildarena up --data {settings.data}`: "
        f"API docs are then at {stack.url}/docs."
    )
    raise typer.Exit(exit_code(sweep))


def start_worker(
    queue: Annotated[
        str, typer.Argument(help="construct, or simulate.ENGINE, such as simulate.mujoco.")
    ],
) -> None:
    """Serve a queue from this process, with the servers that BUILDARENA_* name, until Ctrl-C."""
    programs = {
        CONSTRUCT_QUEUE: ["buildarena_worker"],
        **{
            simulate_queue(engine): ["buildarena_simworker", "--engine", engine]
            for engine in SIMULATORS
        },
    }
    if queue not in programs:
        raise CommandError(f"there is no queue {queue!r}; choose from {', '.join(programs)}")
    # The worker takes this process' place, so that signals reach it.
    os.execv(sys.executable, [sys.executable, "-m", *programs[queue]])  # noqa: S606 - no shell


def migrate() -> None:
    """Bring the database named by BUILDARENA_DATABASE_URL to this program's schema."""
    try:
        url = Settings().required_database_url()
    except ValueError as error:
        raise CommandError(str(error)) from error
    database = Database(url)
    console.print(f"schema {database.migrate()}")
    database.close()


def _settings(data: Path | None, port: int | None, *, require_keys: bool | None = None) -> Settings:
    given: dict[str, Any] = {"data": data, "port": port, "require_keys": require_keys}
    try:
        return Settings(**{name: value for name, value in given.items() if value is not None})
    except ValidationError as error:
        first = error.errors()[0]
        name = "_".join(str(part) for part in first["loc"])
        raise CommandError(
            f"--{name} or BUILDARENA_{name.upper()}: {first['msg']}, got {first['input']!r}"
        ) from error


def _unlocked(settings: Settings) -> bool:
    import fcntl

    try:
        with (settings.data / "lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


def _interrupt_on_terminate() -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    signal.signal(signal.SIGTERM, interrupt)


def _tell_simulators() -> None:
    if "pybullet" not in SIMULATORS:
        _tell("PyBullet is not installed: machines are simulated with MuJoCo alone")


def _tell(line: str) -> None:
    console.print(f"· {line}")
