"""Keys, budgets and the database's roles as operators and researchers use them."""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import yaml
from sqlalchemy import make_url, text
from support.clients.tenants import ADMIN, WITH_KEYS
from support.servers.live_api import changed, live_api
from typer.testing import CliRunner, Result

from buildarena_backend.database.database import Database
from buildarena_cli.errors import CommandError
from buildarena_cli.main import app

Call = Callable[..., Result]


@pytest.fixture
def call(context, monkeypatch) -> Iterator[Call]:
    """Runs commands with a key against an API that asks for one."""
    with changed(context, **WITH_KEYS) as own, live_api(own) as url:
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


def test_running_a_file_again_takes_the_sweep_up_with_another_budget(call, tmp_path) -> None:
    key = made(call)["secret"]
    file = tmp_path / "sweep.yaml"
    payload = {"tasks": ["lift-1"], "models": ["builtin/idle"], "seeds": [0]}
    file.write_text(yaml.safe_dump({**payload, "budget": {"max_requests": 5}}))
    words = ("sweep", "run", str(file), "--detach", "--json")
    first = json.loads(call(*words, key=key).stdout)
    again = json.loads(call(*words, "--max-requests", "9", key=key).stdout)
    assert (again["id"], again["resumed"], again["added"]) == (first["id"], True, 0)
    shown = call("sweep", "status", first["id"], key=key).stdout
    assert "budget: 0 of 9 requests" in shown
    call("sweep", "pause", first["id"], key=key)
    assert "active" in call("sweep", "resume", first["id"], "--max-cost-usd", "3", key=key).stdout
    assert "$0.00 of $3.00" in call("sweep", "status", first["id"], key=key).stdout


def test_a_key_is_rotated_with_what_it_owns(call) -> None:
    key = made(call, "--scope", "submit")
    submit = ("job", "submit", "lift-1", "builtin/idle", "--json")
    first = json.loads(call(*submit, key=key["secret"]).stdout)
    rotate = ("admin", "key", "rotate", key["id"], "--json", "--overlap")
    done = json.loads(call(*rotate, "30m").stdout)
    assert done["id"] == key["id"]
    assert done["secret"] != key["secret"]
    for secret in (key["secret"], done["secret"]):
        assert call("job", "show", first["id"], key=secret).exit_code == 0
    last = json.loads(call(*rotate, "0").stdout)
    with pytest.raises(CommandError, match=r"is replaced: set BUILDARENA_KEY"):
        call("job", "list", key=done["secret"])
    with pytest.raises(CommandError, match="unknown API key"):
        call("job", "list", key=key["secret"])
    assert call("job", "cancel", first["id"], key=last["secret"]).exit_code == 0


def test_a_wrong_scope_or_overlap_is_named(call) -> None:
    with pytest.raises(CommandError, match="'root'; choose from read, submit, admin"):
        call("admin", "key", "create", "x", "--scope", "root")
    for overlap in ("1", "-1h", "1w", "h", "1.5h", "", "9999999h", "1h "):
        with pytest.raises(CommandError, match=r"--overlap .* is not a time"):
            call("admin", "key", "rotate", "key_0", f"--overlap={overlap}")
    with pytest.raises(CommandError, match="overlap_hours"):
        call("admin", "key", "rotate", made(call)["id"], "--overlap", "91d")


# What a deployment runs before its processes start


@pytest.fixture
def fresh(database_url: str) -> Iterator[str]:
    """A database without any table."""
    name = f"{make_url(database_url).database}_fresh"
    superuser = Database(database_url)
    with superuser.statement() as connection:
        connection.execute(text(f"CREATE DATABASE {name}"))
    yield make_url(database_url).set(database=name).render_as_string(hide_password=False)
    with superuser.statement() as connection:
        connection.execute(text(f"DROP DATABASE {name} WITH (FORCE)"))
        for role in ("owner", "api"):
            connection.execute(text(f'DROP ROLE IF EXISTS "{name}_{role}"'))
    superuser.close()


def admin(url: str, *words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "buildarena_cli", "admin", *words]
    environment = {**os.environ, "BUILDARENA_DATABASE_URL": url}
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


def login(folder: Path, url: str, role: str, password: str) -> tuple[str, str]:
    """The argument that names a login's file, and its URL."""
    own = make_url(url).set(username=f"{make_url(url).database}_{role}", password=password)
    file = folder / role
    file.write_text(own.render_as_string(hide_password=False) + "\n")
    return f"{role}={file}", file.read_text().strip()


@pytest.mark.ci
def test_roles_then_migration_by_an_owner_who_is_no_superuser(fresh, tmp_path) -> None:
    owner, owner_url = login(tmp_path, fresh, "owner", "first")
    api, api_url = login(tmp_path, fresh, "api", "first")
    roles = admin(fresh, "roles", owner, api)
    assert (roles.returncode, roles.stdout.strip()) == (0, "logins for owner, api"), roles.stderr
    migrated = admin(owner_url, "migrate")
    assert migrated.returncode == 0, migrated.stderr
    assert admin(api_url, "migrate").returncode != 0
    api, renewed = login(tmp_path, fresh, "api", "second")
    assert admin(fresh, "roles", api).returncode == 0
    database = Database(renewed)
    database.require_schema()
    database.close()
    refused = admin(api_url, "migrate")
    assert refused.returncode != 0
    assert "second" not in refused.stderr + refused.stdout
    for word, says in (("api", "'api' is not ROLE=FILE"), (f"chief={tmp_path}/api", "no role 'ch")):
        done = admin(fresh, "roles", word)
        assert (done.returncode, says in done.stderr) == (1, True), done.stderr
