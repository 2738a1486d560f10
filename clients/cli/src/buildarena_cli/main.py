"""The command ``buildarena``."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from buildarena_cli.client import Client
from buildarena_cli.commands import (
    jobs,
    keys,
    leaderboard,
    machine,
    machine_files,
    models,
    report,
    service,
    sweeps,
    tasks,
)
from buildarena_cli.commands.doctor import examine
from buildarena_cli.errors import FAILED, CommandError
from buildarena_cli.options import DEFAULT_URL, JsonOption, UrlOption
from buildarena_cli.output import error_console

app = typer.Typer(
    help="Find out whether language models can engineer.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.add_typer(sweeps.app, name="sweep")
app.add_typer(jobs.app, name="job")
app.add_typer(keys.app, name="key")
app.add_typer(tasks.app, name="task")
app.add_typer(models.models, name="model")
app.add_typer(machine.app, name="machine")

app.command()(service.up)
app.command()(service.demo)
app.command()(service.migrate)
workers = typer.Typer(help="Run workers by themselves.", no_args_is_help=True)
workers.command("start")(service.start_worker)
app.add_typer(workers, name="worker")
machine.app.command("check")(machine_files.check)
machine.app.command("export")(machine_files.export)
jobs.app.command("replay")(machine_files.replay)
for command in (
    leaderboard.leaderboard,
    leaderboard.compare,
    leaderboard.export,
    leaderboard.audit,
    report.report,
):
    app.command()(command)


@app.command()
def doctor(url: UrlOption = DEFAULT_URL, as_json: JsonOption = False) -> None:
    """Tell what is wrong with the service and what to do; exit code 1 when anything is."""
    if not examine(Client(url), as_json=as_json):
        raise typer.Exit(FAILED)


@app.command()
def mcp(
    url: UrlOption = DEFAULT_URL,
    http: Annotated[
        int | None, typer.Option("--http", help="Serve streamable HTTP on this loopback port.")
    ] = None,
) -> None:
    """Let agents that speak the Model Context Protocol build and be scored."""
    import asyncio

    from buildarena_cli.mcp_server import make_server, serve_stdio

    if http is None:
        asyncio.run(serve_stdio(Client(url)))
        return
    import uvicorn

    server = make_server(Client(url)).streamable_http_app()
    uvicorn.run(server, host="127.0.0.1", port=http, log_level="warning")


def run() -> None:
    """Runs the command line and exits with its code."""
    try:
        app()
    except CommandError as error:
        error_console.print(str(error), soft_wrap=True, markup=False)
        sys.exit(error.code)
