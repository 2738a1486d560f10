"""Backups: what is restored elsewhere is what was there, down to each figure and byte."""

import json
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import text
from support.clients.commands import Done, run
from support.programs import variables_of
from support.servers.run_servers import execute
from support.stages import work

from buildarena_backend.catalog.specs import SweepSpec
from buildarena_backend.database.tables import metadata
from buildarena_backend.process.context import Context, open_context

SWEEP = {"tasks": ["support-1"], "models": ["builtin/expert", "builtin/idle"], "seeds": [0]}


def command(context: Context, *words: str, **environment: str) -> Done:
    return run(*words, **(variables_of(context.settings) | environment))


@pytest.fixture
def elsewhere(context, tmp_path) -> Iterator[Callable[[], Context]]:
    """An empty database and an empty folder, as on another machine."""
    url, name = context.settings.required_database_url(), f"elsewhere_{os.getpid()}"
    opened: list[Context] = []

    def there() -> Context:
        settings = context.settings.model_copy(
            update={"database_url": url.rsplit("/", 1)[0] + f"/{name}", "data": tmp_path / "there"}
        )
        opened.append(open_context(settings))
        return opened[-1]

    execute(url, f"CREATE DATABASE {name}")
    yield there
    for other in opened:
        other.close()
    execute(url, f"DROP DATABASE {name} WITH (FORCE)")


def rows(context: Context) -> dict[str, list[str]]:
    """Every row of every table, as text."""
    with context.store.database.transaction() as connection:
        return {
            table.name: sorted(
                str(row[0]) for row in connection.execute(text(f"SELECT t::text FROM {table} t"))
            )
            for table in metadata.sorted_tables
        }


def stored(context: Context) -> dict[str, bytes]:
    return {item.hash: context.artifacts.get(item.hash) for item in context.artifacts.all()}


def backup(context: Context, place: Path, *words: str) -> tuple[int, dict[str, Any]]:
    """Backs up, lists or checks; the exit code and what it says."""
    done = command(context, "admin", "backup", str(place), *words, "--json")
    return done.returncode, json.loads(done.stdout)


@pytest.fixture
def place(context, submissions, tmp_path) -> Path:
    """A place with the backup of a service whose two jobs have ended."""
    submissions.submit_sweep(SweepSpec.model_validate(SWEEP))
    work(context)
    code, made = backup(context, tmp_path / "b", "--name", "one")
    assert (code, made["copied"]) == (0, len(stored(context)))
    return tmp_path / "b"


def test_a_restored_service_is_the_one_that_was_backed_up(context, place, elsewhere) -> None:
    other = elsewhere()
    restored = command(other, "admin", "restore", str(place))
    assert restored.returncode == 0, restored.stderr
    assert rows(other) == rows(context)
    assert stored(other) == stored(context)
    work(other)  # nothing is left to do there
    assert rows(other)["journal"] == rows(context)["journal"]
    code, again = backup(context, place, "--name", "two")
    assert (code, again["copied"]) == (0, 0), "only what is new is copied"
    _, listed = backup(context, place, "--list")
    assert [one["name"] for one in listed] == ["one", "two"]


def test_a_job_half_way_goes_on_elsewhere_once(context, submissions, elsewhere, tmp_path) -> None:
    submissions.submit_sweep(SweepSpec.model_validate({**SWEEP, "models": ["builtin/expert"]}))
    work(context, steps=1)
    asked = rows(context)["journal"]
    assert asked
    assert command(context, "admin", "backup", str(tmp_path / "b")).returncode == 0
    other = elsewhere()
    assert command(other, "admin", "restore", str(tmp_path / "b")).returncode == 0
    work(other)
    (job,) = other.store.jobs.page(limit=10)
    assert (job.state, job.outcome) == ("done", "success")
    assert set(rows(other)["journal"]) >= set(asked)


def test_a_damaged_backup_is_refused_and_the_database_stays_empty(place, elsewhere) -> None:
    other = elsewhere()
    for file in [file for file in place.glob("one/*") if file.name != "manifest.json"]:
        whole = file.read_bytes()
        file.write_bytes(whole[:-1] + b"?")
        refused = command(other, "admin", "restore", str(place))
        assert (refused.returncode, "damaged" in refused.stderr) == (1, True), file
        file.write_bytes(whole)
    assert other.store.database.schema() is None
    assert command(other, "admin", "restore", str(place)).returncode == 0


def trajectory_in(place: Path, context: Context) -> tuple[Path, str]:
    """The file of a job's trajectory in a place of backups, and what it is to the job."""
    for job in context.store.jobs.page(limit=10):
        if digest := context.store.jobs.artifacts(job.id).get("trajectory-0"):
            return place / "artifacts" / digest[:2] / digest, f"{job.id}/trajectory-0"
    raise AssertionError


def test_a_damaged_artifact_is_found_and_copied_again(context, place) -> None:
    file, _ = trajectory_in(place, context)
    whole = file.read_bytes()
    assert backup(context, place, "--check")[0] == 0
    for name, damaged in (("two", whole[:-1] + b"?"), ("three", whole[:100])):
        file.write_bytes(damaged)
        code, found = backup(context, place, "--check")
        assert (code, list(found["problems"])) == (3, [file.name])
        assert backup(context, place, "--name", name)[0] == 0
        assert file.read_bytes() == whole


def test_what_is_left_is_saved_and_restored_and_the_rest_named(context, place, elsewhere) -> None:
    other = elsewhere()
    for folder in (place, context.settings.data):  # lost in the backup, and in the store itself
        file, use = trajectory_in(folder, context)
        file.unlink()
    refused = command(other, "admin", "restore", str(place))
    assert (refused.returncode, "--allow-missing-artifacts" in refused.stderr) == (1, True)
    assert other.store.database.schema() is None
    made = command(context, "admin", "backup", str(place), "--name", "two")
    assert made.returncode == 3
    assert f"missing or damaged in the store: {file.name}" in made.stdout
    restored = command(other, "admin", "restore", str(place), "--name", "two", "--json")
    assert (restored.returncode, json.loads(restored.stdout)["lost"]) == (3, {file.name: [use]})
    assert rows(other) == rows(context)
    assert set(stored(other)) == {item.hash for item in context.artifacts.all()} - {file.name}


def test_refusals_name_the_offender_and_the_choices(context, elsewhere, tmp_path) -> None:
    place = str(tmp_path / "b")
    assert command(context, "admin", "backup", place, "--name", "one").returncode == 0
    other = elsewhere()
    manifest = tmp_path / "b/one/manifest.json"
    empty = tmp_path / "empty"
    empty.mkdir()
    for words, said in (
        (("backup", place, "--name", "one"), "has a backup 'one' already"),
        (("backup", place, "--name", "../one"), "can't be called '../one'"),
        (("backup", place, "--name", "artifacts"), "can't be called 'artifacts'"),
        (("restore", place, "--name", "two"), "no complete backup 'two'; the newest are: one"),
        (("restore", str(empty)), "has no complete backup"),
        (("restore", place), "the database is not empty"),
        (("backup", "/proc/nowhere"), "can't be used for backups"),
    ):
        refused = command(context, "admin", *words)
        assert (refused.returncode, said in refused.stderr) == (1, True), refused.stderr
    newer = json.loads(manifest.read_text()) | {"schema": "2099_01_01_flight", "version": "9.0"}
    manifest.write_text(json.dumps(newer))
    refused = command(other, "admin", "restore", place)
    assert "made by version 9.0" in refused.stderr
    nobody = command(
        context, "admin", "backup", place, BUILDARENA_DATABASE_URL="postgresql://a@127.0.0.1:9/x"
    )
    assert "the database can't be reached" in nobody.stderr


def test_a_password_stands_in_no_list_of_processes(tmp_path, monkeypatch) -> None:
    seen = tmp_path / "seen"
    program = tmp_path / "pg_dump"
    program.write_text(f'#!/bin/sh\necho "$@" > {seen}\nexit 1\n')
    program.chmod(0o755)
    from buildarena_cli.backups import programs
    from buildarena_cli.errors import CommandError

    monkeypatch.setattr(programs, "_program", lambda _: program)
    with pytest.raises(CommandError, match="pg_dump: exit code 1"):
        programs.run_program("pg_dump", "postgresql://u:secret@127.0.0.1/x", "--file=f")
    assert "secret" not in seen.read_text()
