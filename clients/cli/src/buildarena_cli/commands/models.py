"""The command that lists the models that submissions can name."""

from __future__ import annotations

from buildarena_cli.client import Client
from buildarena_cli.options import DEFAULT_URL, JsonOption, UrlOption, new_group
from buildarena_cli.terminal.output import print_json, print_table

app = new_group("Look at models.")


@app.command("list")
def list_models(*, url: UrlOption = DEFAULT_URL, as_json: JsonOption = False) -> None:
    """List the models of the registry."""
    models = Client(url).models()
    if as_json:
        print_json(models)
        return
    print_table(
        ("model", "provider", "snapshot"),
        [(m["name"] + ("*" if m["baseline"] else ""), m["provider"], m["model"]) for m in models],
        notes=["* baseline"] if any(m["baseline"] for m in models) else [],
    )
