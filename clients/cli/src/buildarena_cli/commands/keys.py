"""The commands of API keys, for the service's admins."""

from __future__ import annotations

from typing import Annotated, Any

import typer
from rich.table import Table

from buildarena_cli.client import Client
from buildarena_cli.options import (
    DEFAULT_URL,
    JsonOption,
    MaxCostOption,
    MaxRequestsOption,
    MaxTokensOption,
    UrlOption,
    budget_of,
)
from buildarena_cli.output import console, number, print_json

app = typer.Typer(
    help="Make, list and revoke API keys. Needs a key with the scope admin in BUILDARENA_KEY.",
    no_args_is_help=True,
)

KeyId = Annotated[str, typer.Argument(help="Id of the key.")]


@app.command("create")
def create_key(
    name: Annotated[str, typer.Argument(help="Who holds it.")],
    *,
    scope: Annotated[
        list[str], typer.Option(help="read, submit or admin; each includes those before it.")
    ] = ["submit"],  # noqa: B006 - typer only reads it
    days: Annotated[int | None, typer.Option(help="How long it is good; for ever without.")] = None,
    max_cost_usd: MaxCostOption = None,
    max_tokens: MaxTokensOption = None,
    max_requests: MaxRequestsOption = None,
    url: UrlOption = DEFAULT_URL,
    as_json: JsonOption = False,
) -> None:
    """Make a key and print its secret, which can't be read again."""
    budget = budget_of(max_cost_usd, max_tokens, max_requests)
    body = {"name": name, "scopes": scope, "days": days, "budget": budget}
    made = Client(url).post("/v1/keys", body)
    if as_json:
        print_json(made)
        return
    console.print(f"{made['id']}  {made['name']}  {', '.join(made['scopes'])}")
    console.print(f"export BUILDARENA_KEY={made['secret']}", soft_wrap=True)


@app.command("list")
def list_keys(*, url: UrlOption = DEFAULT_URL, as_json: JsonOption = False) -> None:
    """List all keys, those that ended included."""
    found = Client(url).get("/v1/keys")
    if as_json:
        print_json(found)
        return
    table = Table()
    for column in ("key", "name", "scopes", "used", "state", "spent"):
        table.add_column(column, overflow="fold")
    for key in found:
        used = key["used_at"]
        state = "revoked" if key["revoked_at"] else "good"
        if key["expires_at"] and not key["revoked_at"]:
            state = f"until {key['expires_at'][:10]}"
        table.add_row(
            key["id"],
            key["name"],
            ", ".join(key["scopes"]),
            "-" if used is None else used[:16].replace("T", " "),
            state,
            spent(key["budget"]),
        )
    console.print(table)


@app.command("revoke")
def revoke_key(key_id: KeyId, *, url: UrlOption = DEFAULT_URL, as_json: JsonOption = False) -> None:
    """End a key at once; what was submitted with it goes on."""
    key = Client(url).post(f"/v1/keys/{key_id}/revoke", {})
    if as_json:
        print_json(key)
    else:
        console.print(f"{key['id']} ({key['name']}) is revoked")


@app.command("budget")
def set_budget(
    key_id: KeyId,
    *,
    max_cost_usd: MaxCostOption = None,
    max_tokens: MaxTokensOption = None,
    max_requests: MaxRequestsOption = None,
    url: UrlOption = DEFAULT_URL,
    as_json: JsonOption = False,
) -> None:
    """Set what all jobs of a key may spend in all; what is not named has no limit."""
    budget = budget_of(max_cost_usd, max_tokens, max_requests) or {}
    key = Client(url).put(f"/v1/keys/{key_id}/budget", budget)
    if as_json:
        print_json(key)
    else:
        console.print(f"{key['id']} ({key['name']}): {spent(key['budget'])}")


def spent(budget: dict[str, Any] | None) -> str:
    """What was spent of a budget, for people."""
    if budget is None:
        return "-"
    parts = []
    if budget["max_cost_usd"] is not None:
        parts.append(
            f"${number(budget['spent_cost_usd'], 2)} of ${number(budget['max_cost_usd'], 2)}"
        )
    for name in ("tokens", "requests"):
        most = budget[f"max_{name}"]
        if most is not None:
            parts.append(f"{budget[f'spent_{name}']:,} of {most:,} {name}")
    return ", ".join(parts) or "no limit"
