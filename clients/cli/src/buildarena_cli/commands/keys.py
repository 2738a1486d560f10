"""The commands of API keys, for the service's admins."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Annotated, Any

import typer

from buildarena_cli.errors import CommandError
from buildarena_cli.ids import path_of
from buildarena_cli.options import (
    KeyId,
    MaxCostOption,
    MaxRequestsOption,
    MaxTokensOption,
    ServiceOption,
    budget_of,
    new_group,
    printed_by,
)
from buildarena_cli.terminal.output import minute_of, number, print_line, print_rows

app = new_group(
    "Make, list, rotate, revoke and reinstate API keys. Needs a key with the scope admin in "
    "BUILDARENA_KEY."
)


def _state(key: dict[str, Any]) -> str:
    if key["revoked_at"]:
        return "revoked"
    if key["suspended_at"]:
        return "suspended"
    return f"until {key['expires_at'][:10]}" if key["expires_at"] else "good"


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


COLUMNS = {
    "key": lambda key: key["id"],
    "name": lambda key: key["name"],
    "scopes": lambda key: ", ".join(key["scopes"]),
    "used": lambda key: minute_of(key["used_at"] or ""),
    "state": _state,
    "spent": lambda key: spent(key["budget"]),
}


def _show(key: dict[str, Any]) -> None:
    print_line(f"{key['id']}  {key['name']}  {', '.join(key['scopes'])}  {_state(key)}")
    if key["budget"] is not None:
        print_line(f"budget: {spent(key['budget'])}")
    if key.get("previous_expires_at"):
        print_line(f"the secret before is good until {key['previous_expires_at']}")
    if key.get("secret"):
        print_line(f"export BUILDARENA_KEY={key['secret']}")


@app.command("create")
@printed_by(_show)
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
    client: ServiceOption,
) -> Any:
    """Make a key and print its secret, which can't be read again."""
    body = {
        "name": name,
        "scopes": scope,
        "expires_in_days": days,
        "budget": budget_of(max_cost_usd, max_tokens, max_requests),
        "simulators": simulator,
        "job_owners": jobs_of,
    }
    return client.post("/v1/keys", body)


@app.command("list")
@printed_by(lambda keys: print_rows(COLUMNS, keys))
def list_keys(*, client: ServiceOption) -> Any:
    """List all keys, including revoked and expired ones."""
    return client.every("/v1/keys")


@app.command("rotate")
@printed_by(_show)
def rotate_key(
    key_id: KeyId,
    *,
    overlap: Annotated[
        str,
        typer.Option(help="Time until the old secret expires: 30m, 24h, 7d; 0 ends it now."),
    ] = "24h",
    client: ServiceOption,
) -> Any:
    """Give a key another secret; it keeps its id, jobs and budget."""
    body = {"overlap_hours": _hours(overlap)}
    return client.post(path_of(client, "key", key_id, "rotate"), body)


@app.command("revoke")
@printed_by(_show)
def revoke_key(key_id: KeyId, *, client: ServiceOption) -> Any:
    """Revoke a key at once; its jobs continue."""
    return client.post(path_of(client, "key", key_id, "revoke"))


@app.command("reinstate")
@printed_by(_show)
def reinstate_key(key_id: KeyId, *, client: ServiceOption) -> Any:
    """Let a runner key work again that was suspended because a trial of its was refuted."""
    return client.post(path_of(client, "key", key_id, "reinstate"))


@app.command("budget")
@printed_by(_show)
def set_budget(
    key_id: KeyId,
    *,
    max_cost_usd: MaxCostOption = None,
    max_tokens: MaxTokensOption = None,
    max_requests: MaxRequestsOption = None,
    client: ServiceOption,
) -> Any:
    """Set the budget of all jobs of a key; omitted limits are removed."""
    budget = budget_of(max_cost_usd, max_tokens, max_requests) or {}
    return client.put(path_of(client, "key", key_id, "budget"), budget)


def _hours(text: str) -> float:
    match = re.fullmatch(r"([0-9]{1,6})([mhd]?)", text)
    if match is None or (not match[2] and int(match[1])):
        raise CommandError(f"--overlap {text!r} is not a time; give one such as 30m, 24h, 7d or 0")
    return int(match[1]) * {"m": 1 / 60, "h": 1, "d": 24, "": 0}[match[2]]
