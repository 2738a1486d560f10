"""Commands that list the models that submissions can name, and check one."""

from __future__ import annotations

from typing import Any

from buildarena_cli.exec import exec_module
from buildarena_cli.options import ModelName, ServiceOption, new_group, printed_by
from buildarena_cli.terminal.output import number, print_rows

app = new_group("List and check models.")
COLUMNS = {
    "model": lambda model: model["name"] + ("*" if model["baseline"] else ""),
    "provider": lambda model: model["provider"],
    "snapshot": lambda model: model["model"],
    "$ in": lambda model: number(model["price"] and model["price"]["input"], 2),
    "$ out": lambda model: number(model["price"] and model["price"]["output"], 2),
}
NOTES = ["* baseline; prices are per million tokens"]


@app.command("list")
@printed_by(lambda models: print_rows(COLUMNS, models, notes=NOTES))
def list_models(*, client: ServiceOption) -> Any:
    """List the models of the registry."""
    return client.models()


@app.command()
def check(name: ModelName) -> None:
    """Send a model one request with a tool from here, and report what is wrong.

    The models file is BUILDARENA_MODELS_FILE, and the provider's key must be set here as it is on
    workers. It needs no running service.
    """
    exec_module(["buildarena_worker", "--ask", name])
