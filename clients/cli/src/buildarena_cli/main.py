"""The command ``buildarena``. Commands load what they need when they are called."""

from __future__ import annotations

import sys
from importlib import metadata
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from buildarena_cli.commands import (
    admin,
    besiege,
    exports,
    jobs,
    leaderboard,
    machine,
    mcp,
    models,
    service,
    service_status,
    site,
    sweeps,
    tasks,
)
from buildarena_cli.errors import PARTIAL, CommandError, explain
from buildarena_cli.options import new_group
from buildarena_cli.terminal.output import is_terminal, print_line, warn
from buildarena_client.errors import ClientError

UNWRAPPED = 10_000
"""Columns of help texts that go to no terminal: a sentence stays one line."""

GROUPS = START, EVALUATE, LOOK, EXTEND, OPERATE = "Start", "Evaluate", "Look", "Extend", "Operate"


class GroupedCommands(TyperGroup):
    """The top-level commands, listed in five groups."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:  # noqa: ARG002 - given by typer
        """Write one section for each group."""
        sections: dict[str, list[tuple[str, str]]] = {title: [] for title in GROUPS}
        for name, command in self.commands.items():
            title = getattr(command, "rich_help_panel", START)
            sections[title].append((name, command.get_short_help_str(UNWRAPPED)))
        for title, rows in sections.items():
            with formatter.section(title):
                formatter.write_dl(rows)

    def invoke(self, ctx: Any) -> Any:
        """Run a command; errors of the client become its own."""
        try:
            return super().invoke(ctx)
        except ClientError as error:
            raise CommandError(explain(error)) from error


app = new_group(
    "Find out whether language models can engineer.", completed=True, kind=GroupedCommands
)


def show_version(asked: bool) -> None:
    """Print the version and exit, if it is asked for."""
    if asked:
        print_line(metadata.version("buildarena"))
        raise typer.Exit


@app.callback()
def main(
    *,
    _: Annotated[
        bool,
        typer.Option(
            "--version", help="Show the version and exit.", callback=show_version, is_eager=True
        ),
    ] = False,
) -> None:
    """Find out whether language models can engineer."""


app.command(rich_help_panel=START)(service.demo)
app.command(rich_help_panel=START)(service.up)
app.command(rich_help_panel=START)(service_status.down)
app.command(rich_help_panel=START)(service_status.doctor)
app.add_typer(sweeps.app, name="sweep", rich_help_panel=EVALUATE)
app.add_typer(jobs.app, name="job", rich_help_panel=EVALUATE)
app.command(rich_help_panel=LOOK)(leaderboard.leaderboard)
app.command(rich_help_panel=LOOK)(leaderboard.compare)
app.command(rich_help_panel=LOOK)(exports.export)
app.command(rich_help_panel=LOOK)(site.site)
app.add_typer(tasks.app, name="task", rich_help_panel=EXTEND)
app.add_typer(models.app, name="model", rich_help_panel=EXTEND)
app.add_typer(machine.app, name="machine", rich_help_panel=EXTEND)
app.add_typer(besiege.app, name="besiege", rich_help_panel=EXTEND)
app.command(rich_help_panel=EXTEND)(mcp.mcp)
app.add_typer(admin.app, name="admin", rich_help_panel=OPERATE)


def run() -> None:
    """Run the command line and exit with its code."""
    try:
        app(**({} if is_terminal() else {"terminal_width": UNWRAPPED, "max_content_width": None}))
    except CommandError as error:
        warn(str(error) if error.code == PARTIAL else f"error: {error}")
        sys.exit(error.code)
