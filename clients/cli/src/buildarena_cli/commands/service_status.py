"""The commands that inspect and stop a service: status, logs, doctor, down."""

from __future__ import annotations

import os
from collections import deque
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any

import typer

from buildarena_cli.errors import DONE, FAILED, CommandError, did_you_mean, explain
from buildarena_cli.options import DataOption, ServiceOption, printed_by
from buildarena_cli.terminal.output import number, print_line, print_rows, print_table
from buildarena_client.client import Client
from buildarena_client.errors import UnreachableError

DEFAULT_DATA = ".buildarena"
"""As the settings have it, whose loading takes longer than most commands."""
MEBIBYTE = 1024 * 1024
PROCESSES = {
    "process": lambda fact: fact["name"],
    "pid": lambda fact: str(fact["pid"]),
    "MiB": lambda fact: number(fact["memory_bytes"] and fact["memory_bytes"] / MEBIBYTE, 0),
    "ports": lambda fact: ", ".join(map(str, fact["ports"])),
    "since": lambda fact: _since(fact["started_at"]),
}


def data_folder(chosen: Path | None) -> Path:
    """Return the data folder: the given one, or BUILDARENA_DATA, or the default."""
    return (chosen or Path(os.environ.get("BUILDARENA_DATA") or DEFAULT_DATA)).absolute()


def down(data: DataOption = None) -> None:
    """Stop the service that runs on the data folder."""
    from buildarena_cli.local.service import stop

    folder = data_folder(data)
    print_line("stopped" if stop(folder) else f"nothing runs on {folder}")


def _since(started_at: float | None) -> str:
    if started_at is None:
        return "gone"
    return f"{datetime.fromtimestamp(started_at).astimezone():%Y-%m-%d %H:%M:%S}"


def _show_status(found: dict[str, Any]) -> None:
    if not found["running"]:
        before = f"; the last run was process {found['pid']}" if found["pid"] else ""
        print_line(f"nothing runs on {found['data']}{before}")
        return
    health = found["health"]
    print_line(f"{health['status']}: API {found['url']}, data {found['data']}")
    print_rows(PROCESSES, found["processes"])
    for check in health["checks"]:
        if not check["ok"]:
            print_line(f"!!  {check['name']}: {check['detail']} {check['advice']}".rstrip())


@printed_by(_show_status, code=lambda found: DONE if found["healthy"] else FAILED)
def status(data: DataOption = None) -> Any:
    """Show which parts of the service run on the data folder.

    The exit code is 0 when everything is healthy, and 1 otherwise.
    """
    from buildarena_cli.local.service import noted_run, process_facts, running

    folder = data_folder(data)
    run, last = running(folder), noted_run(folder)
    found = {"running": run is not None, "data": str(folder), "pid": last and last.pid}
    if run is None:
        return {**found, "healthy": False}
    advice = "`buildarena admin logs api` says why" if run.ready else "it is starting"
    health, processes = _health(Client(run.url), advice), process_facts(run)
    healthy = health["status"] == "ok" and all(fact["started_at"] is not None for fact in processes)
    return {**found, "url": run.url, "healthy": healthy, "processes": processes, "health": health}


def logs(
    process: Annotated[str | None, typer.Argument(help="Name of a process; default: all.")] = None,
    *,
    lines: Annotated[
        int, typer.Option("--lines", "-n", help="Lines of each log at most.", min=0)
    ] = 50,
    data: DataOption = None,
) -> None:
    """Print the logs of the service's processes."""
    from buildarena_cli.local.service import log_files, log_name

    folder = data_folder(data)
    files = log_files(folder)
    if not files:
        raise CommandError(f"{folder / 'logs'} contains no logs")
    if process is not None:
        name = log_name(process)
        if name not in files:
            raise CommandError(
                f"unknown process {process!r}; valid processes: {', '.join(files)}"
                f"{did_you_mean(name, files)}"
            )
        files = {name: files[name]}
    width = max(map(len, files)) if len(files) > 1 else 0
    for name, file in files.items():
        with file.open("rb") as log:
            for line in deque(log, maxlen=lines):
                prefix = f"{name:<{width}}  " if width else ""
                print_line(prefix + line.decode(errors="replace").rstrip("\n"))


def _show_health(health: dict[str, Any]) -> None:
    print_line(f"BuildArena is {health['status']}")
    rows = [
        ("ok" if check["ok"] else "!!", check["name"], check["detail"])
        for check in health["checks"]
    ]
    print_table(("is", "check", "finding"), rows)
    for check in health["checks"]:
        if check["advice"]:
            print_line(f"{check['name']}: {check['advice']}")


@printed_by(_show_health, code=lambda health: DONE if health["status"] == "ok" else FAILED)
def doctor(*, client: ServiceOption) -> Any:
    """List problems of the service and their solutions.

    The exit code is 1 when anything is wrong.
    """
    return _health(client)


def _health(client: Client, advice: str | None = None) -> dict[str, Any]:
    """Return the service's health; without an answer, a failed check with advice."""
    try:
        return dict(client.health())
    except UnreachableError as error:
        check = {"name": "API", "ok": False, "detail": "does not answer"}
        return {"status": "down", "checks": [{**check, "advice": advice or explain(error)}]}
