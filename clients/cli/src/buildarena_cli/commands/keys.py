"""The commands of API keys, for the service's admins."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Annotated, Any

import typer

from buildarena_cli.client import Client, at
from buildarena_cli.errors import CommandError
from buildarena_cli.ids import resolve_id
from buildarena_cli.options import (
    DEFAULT_URL,
    JsonOption,
    KeyId,
    MaxCostOption,
    MaxRequestsOption,
    MaxTokensOption,
    UrlOption,
    budget_of,
    new_group,
)
from buildarena_cli.terminal.output import minute_of, number, print_json, print_table, say

app = new_group(
    "Make, list, rotate, revoke and reinstate API keys. Needs a key with the scope admin in "
    "BUILDARENA_KEY."
)
COLUMNS = ("key", "name", "scopes", "used", "state", "spent")


@app.command("create")
def create_key(
    name: Annotated[str, typer.Argument(help="Label for the key, usually its holder.")],
    *,
    scope: Annotated[
        list[str],
        typer.Option(
            help="read, submit or admin, each including those before it; or runner alone."
        ),
    ] = ["submit"],  # noqa: B006 - typer only reads it
    simulator: Annotated[
        list[str] | None,
        typer.Option(help="For a runner key: a simulator whose jobs it may lease; repeatable."),
    ] = None,
    jobs_of: Annotated[
        list[str] | None,
        typer.Option(help="For a runner key: only jobs of this key (id); repeatable."),
    ] = None,
    days: Annotated[
        int | None, typer.Option(help="Days until it expires; never by default.")
    ] = None,
    max_cost_usd: MaxCostOption = None,
    max_tokens: MaxTokensOption = None,
    max_requests: MaxRequestsOption = None,
    url: UrlOption = DEFAULT_URL,
    as_json: JsonOption = False,
) -> None:
    """Make a key and print its secret, which can't be read again."""
    budget = budget_of(max_cost_usd, max_tokens, max_requests)
    body: dict[str, Any] = {
        "name": name,
        "scopes": scope,
        "expires_in_days": days,
        "budget": budget,
    }
    # Omitted unless requested: services without runner keys reject them.
    restrictions = {"simulators": simulator, "job_owners": jobs_of}
    key = Client(url).post("/v1/keys", body | {k: v for k, v in restrictions.items() if v})
    if as_json:
        print_json(key)
        return
    say(f"{key['id']}  {key['name']}  {', '.join(key['scopes'])}")
    say(f"export BUILDARENA_KEY={key['secret']}")


@app.command("list")
def list_keys(*, url: UrlOption = DEFAULT_URL, as_json: JsonOption = False) -> None:
    """List all keys, including revoked and expired ones."""
    keys = Client(url).every("/v1/keys")
    if as_json:
        print_json(keys)
        return
    print_table(COLUMNS, [_row(key) for key in keys])


@app.command("rotate")
def rotate_key(
    key_id: KeyId,
    *,
    overlap: Annotated[
        str,
        typer.Option(help="Time until the old secret expires: 30m, 24h, 7d; 0 ends it now."),
    ] = "24h",
    url: UrlOption = DEFAULT_URL,
    as_json: JsonOption = False,
) -> None:
    """Give a key another secret; it keeps its id, jobs and budget."""
    hours = _hours(overlap)
    client = Client(url)
    path = at("keys", resolve_id(client, "key", key_id), "rotate")
    key = client.post(path, {"overlap_hours": hours})
    if as_json:
        print_json(key)
        return
    say(
        f"{key['id']} ({key['name']}): the secret before is good until {key['previous_expires_at']}"
    )
    say(f"export BUILDARENA_KEY={key['secret']}")


@app.command("revoke")
def revoke_key(key_id: KeyId, *, url: UrlOption = DEFAULT_URL, as_json: JsonOption = False) -> None:
    """Revoke a key at once; its jobs continue."""
    _change(url, key_id, "revoke", "is revoked", as_json=as_json)


@app.command("reinstate")
def reinstate_key(
    key_id: KeyId, *, url: UrlOption = DEFAULT_URL, as_json: JsonOption = False
) -> None:
    """Let a runner key work again that was suspended because a trial of its was refuted."""
    _change(url, key_id, "reinstate", "may lease trials", as_json=as_json)


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
    """Set the budget of all jobs of a key; omitted limits are removed."""
    budget = budget_of(max_cost_usd, max_tokens, max_requests) or {}
    client = Client(url)
    key = client.put(at("keys", resolve_id(client, "key", key_id), "budget"), budget)
    if as_json:
        print_json(key)
    else:
        say(f"{key['id']} ({key['name']}): {spent(key['budget'])}")


def _change(url: str, key_id: str, verb: str, outcome: str, *, as_json: bool) -> None:
    client = Client(url)
    key = client.post(at("keys", resolve_id(client, "key", key_id), verb), {})
    if as_json:
        print_json(key)
    else:
        say(f"{key['id']} ({key['name']}) {outcome}")


def _hours(text: str) -> float:
    match = re.fullmatch(r"([0-9]{1,6})([mhd]?)", text)
    if match is None or (not match[2] and int(match[1])):
        raise CommandError(f"--overlap {text!r} is not a time; give one such as 30m, 24h, 7d or 0")
    return int(match[1]) * {"m": 1 / 60, "h": 1, "d": 24, "": 0}[match[2]]


def spent(budget: Mapping[str, Any] | None) -> str:
    """Return a budget's use as text."""
    if budget is None:
        return "-"
    parts = []
    if budget["max_cost_usd"] is not None:
        parts.append(
            f"${number(budget['used_cost_usd'], 2)} of ${number(budget['max_cost_usd'], 2)}"
        )
    for name in ("tokens", "requests"):
        limit = budget[f"max_{name}"]
        if limit is not None:
            parts.append(f"{budget[f'used_{name}']:,} of {limit:,} {name}")
    return ", ".join(parts) or "no limit"


def _row(key: dict[str, Any]) -> list[str]:
    used = key["used_at"]
    state = f"until {key['expires_at'][:10]}" if key["expires_at"] else "good"
    if key.get("suspended_at"):
        state = "suspended"
    if key["revoked_at"]:
        state = "revoked"
    return [
        key["id"],
        key["name"],
        ", ".join(key["scopes"]),
        "" if used is None else minute_of(used),
        state,
        spent(key["budget"]),
    ]
