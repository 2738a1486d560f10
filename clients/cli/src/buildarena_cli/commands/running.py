"""The commands that inspect and stop a service: status, logs, doctor, down."""

from __future__ import annotations

from collections import deque
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from buildarena_cli.defaults import data_folder
from buildarena_cli.errors import FAILED, CommandError, did_you_mean
from buildarena_cli.options import DEFAULT_URL, DataOption, JsonOption, UrlOption
from buildarena_cli.terminal.output import number, print_json, print_table, say

if TYPE_CHECKING:
    from buildarena_cli.local.service import ProcessFacts, Run

MEBIBYTE = 1024 * 1024


def down(data: DataOption = None) -> None:
    """Stop the service that runs on the data folder."""
    from buildarena_cli.local.service import stop

    folder = data_folder(data)
    say("stopped" if stop(folder) else f"nothing runs on {folder.absolute()}")


def status(data: DataOption = None, *, as_json: JsonOption = False) -> None:
    """Show which parts of the service run on the data folder.

    The exit code is 0 when everything is healthy, and 1 otherwise.
    """
    from buildarena_cli.local.service import noted_run, process_facts, running

    folder = data_folder(data).absolute()
    run = running(folder)
    if run is None:
        last = noted_run(folder)
        if as_json:
            print_json({"running": False, "data": str(folder)})
        else:
            before = f"; the last run was process {last.pid}" if last else ""
            say(f"nothing runs on {folder}{before}")
        raise typer.Exit(FAILED)
    health, facts = _health(run), process_facts(run)
    healthy = health["status"] == "ok" and all(fact.started_at is not None for fact in facts)
    if as_json:
        shown = {"running": True, "data": str(folder), "url": run.url, "pid": run.pid}
        print_json(
            {**shown, "healthy": healthy, "processes": list(map(asdict, facts)), "health": health}
        )
    else:
        _show(run, folder, health, facts)
    if not healthy:
        raise typer.Exit(FAILED)


def logs(
    process: Annotated[
        str | None,
        typer.Argument(help="Name of a process; default: all."),
    ] = None,
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
        raise CommandError(f"{folder.absolute() / 'logs'} contains no logs")
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
                say(prefix + line.decode(errors="replace").rstrip("\n"))


def doctor(url: UrlOption = DEFAULT_URL, as_json: JsonOption = False) -> None:
    """List problems of the service and their solutions.

    The exit code is 1 when anything is wrong.
    """
    from buildarena_cli.client import Client

    client = Client(url)
    health = _health_at(url)
    if as_json:
        print_json(health)
    else:
        say(f"BuildArena at {client.url}: {health['status']}")
        rows = [
            ("ok" if check["ok"] else "!!", check["name"], check["detail"])
            for check in health["checks"]
        ]
        print_table(("is", "check", "finding"), rows)
        for check in health["checks"]:
            if check["advice"]:
                say(f"{check['name']}: {check['advice']}")
    if health["status"] != "ok":
        raise typer.Exit(FAILED)


def _health_at(url: str, *, advice: str | None = None) -> dict[str, Any]:
    """Return the service's health; without an answer, a failed check with advice."""
    from buildarena_cli.client import HEALTH, Client, UnreachableError

    try:
        health: dict[str, Any] = Client(url).get(HEALTH)
    except UnreachableError as error:
        does_not = {"name": "API", "ok": False, "detail": "does not answer"}
        api = {**does_not, "advice": advice or str(error)}
        return {"status": "down", "checks": [api]}
    return health


def _health(run: Run) -> dict[str, Any]:
    advice = "`buildarena admin logs api` says why" if run.ready else "it is starting"
    return _health_at(run.url, advice=advice)


def _show(run: Run, folder: Path, health: dict[str, Any], facts: list[ProcessFacts]) -> None:
    say(f"{health['status']}: API {run.url}, data {folder}")
    rows = []
    for fact in facts:
        gone = fact.started_at is None
        memory = None if fact.memory_bytes is None else fact.memory_bytes / MEBIBYTE
        since = datetime.fromtimestamp(fact.started_at or 0).astimezone()
        rows.append(
            (
                fact.name,
                str(fact.pid),
                number(memory, 0),
                ", ".join(map(str, fact.ports)),
                "gone" if gone else f"{since:%Y-%m-%d %H:%M:%S}",
            )
        )
    print_table(("process", "pid", "MiB", "ports", "since"), rows, numeric=("pid", "MiB"))
    for check in health["checks"]:
        if not check["ok"]:
            say(f"!!  {check['name']}: {check['detail']} {check['advice']}".rstrip())
