"""`buildarena admin roles` and `migrate`: what a deployment runs before its processes start."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from sqlalchemy import make_url, text

from buildarena_store import Database


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


def command(url: str, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "buildarena_cli", *words],
        env={**os.environ, "BUILDARENA_DATABASE_URL": url},
        capture_output=True,
        text=True,
        check=False,
    )


def login(folder: Path, url: str, role: str, password: str) -> tuple[str, str]:
    """The argument that names a login's file, and its URL."""
    name = f"{make_url(url).database}_{role}"
    own = make_url(url).set(username=name, password=password)
    file = folder / role
    file.write_text(own.render_as_string(hide_password=False) + "\n")
    return f"{role}={file}", file.read_text().strip()


def who(url: str) -> str:
    database = Database(url)
    try:
        with database.transaction() as connection:
            return str(connection.execute(text("SELECT current_user")).scalar())
    finally:
        database.close()


@pytest.mark.ci
def test_roles_then_migration_by_an_owner_who_is_no_superuser(fresh, tmp_path) -> None:
    (owner, owner_url), (api, api_url) = (
        login(tmp_path, fresh, role, "first") for role in ("owner", "api")
    )
    made = command(fresh, "admin", "roles", owner, api)
    assert (made.returncode, made.stdout.strip()) == (0, "logins for owner, api"), made.stderr
    migrated = command(owner_url, "admin", "migrate")
    assert migrated.returncode == 0, migrated.stderr
    assert command(api_url, "admin", "migrate").returncode != 0
    database = Database(api_url)
    database.require_schema()
    database.close()
    api, renewed = login(tmp_path, fresh, "api", "second")
    assert command(fresh, "admin", "roles", api).returncode == 0
    assert who(renewed) == make_url(renewed).username
    refused = command(api_url, "admin", "migrate")
    assert refused.returncode != 0
    assert "second" not in refused.stderr + refused.stdout


@pytest.mark.ci
@pytest.mark.parametrize(
    ("words", "message", "code"),
    [
        (["api"], "'api' is not ROLE=FILE", 1),
        (["api=/nowhere/url"], "/nowhere/url can't be read", 2),
        (["chief={file}"], "no role 'chief'", 1),
    ],
)
def test_mistakes_are_named(database_url, tmp_path, words, message, code) -> None:
    file = tmp_path / "url"
    file.write_text("postgresql://a:b@h/d")
    done = command(database_url, "admin", "roles", *(word.format(file=file) for word in words))
    assert done.returncode == code
    assert message in done.stderr
