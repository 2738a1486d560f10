"""Commands that list the models that submissions can name, and check one."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from buildarena_cli.client import Client
from buildarena_cli.exec import exec_module
from buildarena_cli.options import DEFAULT_URL, JsonOption, UrlOption, new_group, to_read
from buildarena_cli.terminal.output import number, print_json, print_table

app = new_group("List and check models.")


@app.command("list")
def list_models(*, url: UrlOption = DEFAULT_URL, as_json: JsonOption = False) -> None:
    """List the models of the registry."""
    models = Client(url).models()
    if as_json:
        print_json(models)
        return
    print_table(
        ("model", "provider", "snapshot", "$ in", "$ out"),
        [
            (
                m["name"] + ("*" if m["baseline"] else ""),
                m["provider"],
                m["model"],
                *(number(m["price"] and m["price"][side], 2) for side in ("input", "output")),
            )
            for m in models
        ],
        numeric=("$ in", "$ out"),
        title="Prices are per million tokens.",
        notes=["* baseline"] if any(m["baseline"] for m in models) else [],
    )


@app.command()
def check(
    name: Annotated[str, typer.Argument(help="Name of the model in the models file.")],
    models_file: Annotated[
        Path | None,
        typer.Option(help="Models file; default: BUILDARENA_MODELS_FILE.", callback=to_read),
    ] = None,
) -> None:
    """Send a model one request with a tool from here, and report what is wrong.

    The provider's key must be set here as it is on workers. It needs no running service.
    """
    if models_file is not None:
        os.environ["BUILDARENA_MODELS_FILE"] = str(models_file)
    exec_module(["buildarena_worker", "--ask", name])
