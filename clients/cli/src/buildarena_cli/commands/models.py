"""The command that lists the models that submissions can name."""

from __future__ import annotations

import typer
from rich.table import Table

from buildarena_cli.client import Client
from buildarena_cli.options import DEFAULT_URL, JsonOption, UrlOption
from buildarena_cli.output import console, print_json

models = typer.Typer(help="Look at models.", no_args_is_help=True)


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
