"""Keys, budgets and the database's roles as operators and researchers use them."""

import json
from collections.abc import Callable, Iterator

import pytest
from support.clients.tenants import ADMIN, WITH_KEYS
from support.servers.live_api import live_api
from typer.testing import CliRunner, Result

from buildarena_cli.errors import CommandError
from buildarena_cli.main import app

Call = Callable[..., Result]


@pytest.fixture
def call(context, monkeypatch) -> Iterator[Call]:
    """Runs commands with a key against an API that asks for one."""
    with live_api(context, **WITH_KEYS) as url:
        monkeypatch.setenv("BUILDARENA_URL", url)

        def run(*words: str, key: str | None = ADMIN) -> Result:
            result = CliRunner().invoke(app, words, env={"BUILDARENA_KEY": key})
            if result.exception is not None and not isinstance(result.exception, SystemExit):
                raise result.exception
            return result

        yield run


def made(call: Call, *words: str) -> dict[str, str]:
    return json.loads(call("admin", "key", "create", "ada", *words, "--json").stdout)


def test_a_key_is_made_used_listed_and_revoked(call) -> None:
    with pytest.raises(CommandError, match=r"an API key is needed.*BUILDARENA_KEY"):
        call("job", "list", key=None)
    key = made(call, "--scope", "submit", "--days", "30", "--max-cost-usd", "12.5")
    assert call("task", "list", key=key["secret"]).exit_code == 0
    listed = call("admin", "key", "list").stdout
    assert key["id"][:8] in listed
    assert key["secret"] not in listed
    call("admin", "key", "budget", key["id"], "--max-requests", "7")
    (shown,) = json.loads(call("admin", "key", "list", "--json").stdout)
    assert (shown["budget"]["max_requests"], shown["budget"]["max_cost_usd"]) == (7, None)
    assert "revoked" in call("admin", "key", "revoke", key["id"]).stdout
    with pytest.raises(CommandError, match=r"is revoked: set BUILDARENA_KEY"):
        call("task", "list", key=key["secret"])


def test_a_wrong_scope_or_overlap_is_named(call) -> None:
    with pytest.raises(CommandError, match="'root'; choose from read, submit, admin"):
        call("admin", "key", "create", "x", "--scope", "root")
    for overlap in ("1", "-1h", "1w", "h", "1.5h", "", "9999999h", "1h "):
        with pytest.raises(CommandError, match=r"--overlap .* is not a time"):
            call("admin", "key", "rotate", "key_0", f"--overlap={overlap}")
    with pytest.raises(CommandError, match="overlap_hours"):
        call("admin", "key", "rotate", made(call)["id"], "--overlap", "91d")


# What a deployment runs before its processes start
