"""The commands that run the service on this machine: up, demo."""

from __future__ import annotations

import shutil
import signal
import time
from typing import TYPE_CHECKING, Annotated, Any

import typer

from buildarena_cli.errors import CommandError
from buildarena_cli.options import DataOption, PortOption, settings_with
from buildarena_cli.terminal.output import print_line

if TYPE_CHECKING:
    from buildarena_backend.settings import Settings

DEMO_SWEEP: dict[str, Any] = {
    "name": "demo",
    "tasks": [
        *("transport-1", "transport-2", "transport-3"),
        *("support-1", "support-2", "support-3"),
        *("lift-1", "lift-2", "lift-3"),
    ],
    "models": ["builtin/expert", "builtin/random", "builtin/idle"],
    # One varied world of the usual four: two minutes, and not four, before there is a board.
    "worlds": 1,
    "seeds": [0, 1, 2, 3],
}


def up(
    data: DataOption = None,
    port: PortOption = None,
    *,
    detach: Annotated[
        bool, typer.Option("--detach", help="Return when it is up; `buildarena down` stops it.")
    ] = False,
    keys: Annotated[
        bool,
        typer.Option(
            "--require-api-keys",
            help="Require an API key for every request; the admin key is written to DATA.",
        ),
    ] = False,
) -> None:
    """Start the whole service on this machine.

    It stays up until Ctrl-C, or in the background with --detach.
    """
    settings = settings_with(data=data, port=port, require_keys=keys or None)
    if detach:
        _detach(settings, keys=keys)
        return
    from buildarena_cli.local.stack import Stack

    # A list takes no lock: a second signal in the middle of an event's would wait for itself.
    asked: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda number, _: asked.append(number))
    _report_simulators()
    with Stack(settings, report=_report) as stack:
        print_line(f"dashboard and API {stack.url}  ·  docs {stack.url}/docs  ·  logs {stack.logs}")
        print_line("Ctrl-C stops it.")
        while not asked:
            time.sleep(0.5)
            stack.require_running()
        _report(
            "stopping: open model requests and trials may finish, for at most "
            f"{settings.finishing_s:.0f} s"
        )


def demo(
    data: DataOption = None,
    port: PortOption = None,
    *,
    task: Annotated[
        list[str] | None, typer.Option(help="Only this task; may be given several times.")
    ] = None,
) -> None:
    """Start everything, run one small sweep, show the leaderboard, and stop."""
    from buildarena_cli.local.service import is_running
    from buildarena_cli.local.stack import Stack
    from buildarena_cli.terminal.boards import overview
    from buildarena_cli.terminal.progress import exit_code, watch_sweep
    from buildarena_client.client import Client
    from buildarena_simulation import ENGINES

    # The demo names its engine: where the default one is missing it shows what another makes of it.
    sweep_file = {**DEMO_SWEEP, "simulator": ENGINES[0]}
    if task:
        sweep_file["tasks"] = task
    settings = settings_with(data=data, port=port)
    settings = settings.model_copy(update={"data": settings.data / "demo"})
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    if not is_running(settings.data):
        shutil.rmtree(settings.data, ignore_errors=True)
    _report_simulators()
    with Stack(settings, report=_report) as stack:
        client = Client(stack.url, key=stack.admin_key)
        sweep_id = client.submit_sweep(sweep_file)["id"]
        sweep = watch_sweep(client, sweep_id)
        stack.require_running()
        overview(client.leaderboard())
    print_line()
    print_line(f"Results are kept in {settings.data.absolute()}.")
    print_line(
        f"See them again with `buildarena up --data {settings.data}`: "
        f"API docs are then at {stack.url}/docs."
    )
    raise typer.Exit(exit_code(sweep))


def _detach(settings: Settings, *, keys: bool) -> None:
    from buildarena_cli.local.service import is_running, start, unwritable

    data = settings.data.absolute()
    if is_running(data):
        raise CommandError(
            f"another BuildArena runs on the data folder {data}: see `buildarena admin status`, "
            "or choose another folder with --data or BUILDARENA_DATA"
        )
    try:
        run = start(data, ["--port", str(settings.port), *(["--require-api-keys"] if keys else [])])
    except OSError as error:
        raise unwritable(data, error) from error
    print_line(
        f"dashboard and API {run.url}  ·  docs {run.url}/docs  ·  pid {run.pid}"
        f"  ·  logs {data / 'logs'}"
    )
    print_line("`buildarena down` stops it.")


def _report_simulators() -> None:
    from buildarena_simulation import UnknownEngineError, require_engine
    from buildarena_simulation.constants import DEFAULT_ENGINE

    try:
        require_engine(DEFAULT_ENGINE)
    except UnknownEngineError as error:
        _report(f"{error}; submissions must name one")


def _report(line: str) -> None:
    print_line(f"· {line}")
