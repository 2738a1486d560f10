"""The command ``buildarena``. Commands load what they need when they are called."""

from __future__ import annotations

import sys

from buildarena_cli.commands import (
    admin,
    besiege,
    exports,
    jobs,
    leaderboard,
    machine,
    mcp,
    models,
    running,
    service,
    site,
    sweeps,
    tasks,
)
from buildarena_cli.errors import CommandError
from buildarena_cli.options import new_group
from buildarena_cli.terminal.output import is_terminal, warn

UNWRAPPED = 10_000
"""Columns of help texts that go to no terminal: a sentence stays one line."""

app = new_group("Find out whether language models can engineer.", completed=True)
app.command()(service.demo)
app.command()(service.up)
app.command()(running.down)
app.command()(running.doctor)
app.add_typer(sweeps.app, name="sweep")
app.add_typer(jobs.app, name="job")
app.command()(leaderboard.leaderboard)
app.command()(leaderboard.compare)
app.command()(exports.export)
app.command()(site.site)
app.add_typer(tasks.app, name="task")
app.add_typer(models.app, name="model")
app.add_typer(machine.app, name="machine")
app.add_typer(besiege.app, name="besiege")
app.command()(mcp.mcp)
app.add_typer(admin.app, name="admin")


def run() -> None:
    """Run the command line and exit with its code."""
    try:
        app(**({} if is_terminal() else {"terminal_width": UNWRAPPED, "max_content_width": None}))
    except CommandError as error:
        warn(str(error))
        sys.exit(error.code)
