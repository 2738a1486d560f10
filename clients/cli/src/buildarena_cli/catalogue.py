"""The commands that list what submissions can name: tasks and models."""

from __future__ import annotations

from typing import Annotated

import typer
from rich.table import Table

from buildarena_cli.client import Client
from buildarena_cli.errors import CommandError
from buildarena_cli.options import DEFAULT_URL, JsonOption, UrlOption
from buildarena_cli.output import console, print_json

tasks = typer.Typer(help="Look at tasks.", no_args_is_help=True)
models = typer.Typer(help="Look at models.", no_args_is_help=True)


@tasks.command("list")
def list_tasks(*, url: UrlOption = DEFAULT_URL, as_json: JsonOption = False) -> None:
    """List the tasks."""
    found = Client(url).get("/v1/tasks")
    if as_json:
        print_json(found)
        return
    table = Table()
    for name in ("task", "title", "indicator", "version"):
        table.add_column(name, overflow="fold")
    for task in found:
        table.add_row(task["name"], task["title"], task["indicator"], task["version"])
    console.print(table)


@tasks.command("show")
def show_task(
    name: Annotated[str, typer.Argument(help="Task name.")],
    *,
    url: UrlOption = DEFAULT_URL,
    as_json: JsonOption = False,
) -> None:
    """Show what a model is told of a task."""
    found = {task["name"]: task for task in Client(url).get("/v1/tasks")}
    if name not in found:
        raise CommandError(f"there is no task {name!r}; choose from {', '.join(found)}")
    if as_json:
        print_json(found[name])
    else:
        console.print(found[name]["statement"], markup=False)


@models.command("list")
def list_models(*, url: UrlOption = DEFAULT_URL, as_json: JsonOption = False) -> None:
    """List the models of the registry."""
    found = Client(url).get("/v1/models")
    if as_json:
        print_json(found)
        return
    table = Table()
    for name in ("model", "provider", "snapshot"):
        table.add_column(name, overflow="fold")
    for model in found:
        mark = "*" if model["baseline"] else ""
        table.add_row(model["name"] + mark, model["provider"], model["model"])
    console.print(table)
