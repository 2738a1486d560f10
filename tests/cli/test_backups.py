"""Backups: what is restored elsewhere is what was there, down to each figure and byte."""

import json
import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from sqlalchemy import create_engine, text
from support.clients.commands import Done, run
from support.servers.databases import MADE_OF_OTHERS
from support.stages import work

from buildarena_pipeline.catalog.specs import SweepSpec
from buildarena_pipeline.runtime.context import Context, open_context
from buildarena_pipeline.submission.submission import Submissions
from buildarena_store.tables import metadata

BUILDARENA = str(Path(sys.executable).with_name("buildarena"))
SWEEP = {"tasks": ["support-1"], "models": ["builtin/expert", "builtin/idle"], "seeds": [0]}


def command(context: Context, *words: str, **environment: str) -> Done:
    service = {
        "BUILDARENA_DATABASE_URL": context.settings.required_database_url(),
        "BUILDARENA_DATA": str(context.settings.data),
    }
    return run(*words, **(service | environment))


@pytest.fixture
def elsewhere(context, tmp_path) -> Iterator[Callable[[], Context]]:
    """An empty database and an empty folder, as on another machine."""
    url, name = context.settings.required_database_url(), f"elsewhere_{os.getpid()}"
    admin = create_engine(
        url.replace("postgresql://", "postgresql+psycopg://"), isolation_level="AUTOCOMMIT"
    )
    opened: list[Context] = []

    def there() -> Context:
        settings = context.settings.model_copy(
            update={"database_url": url.rsplit("/", 1)[0] + f"/{name}", "data": tmp_path / "there"}
        )
        opened.append(open_context(settings))
        return opened[-1]

    with admin.connect() as connection:
        connection.execute(text(f"CREATE DATABASE {name}"))
    yield there
    for other in opened:
        other.close()
    with admin.connect() as connection:
        connection.execute(text(f"DROP DATABASE {name} WITH (FORCE)"))
    admin.dispose()


def submit(submissions: Submissions, spec: dict[str, object]) -> None:
    submissions.submit_sweep(SweepSpec.model_validate(spec))


def rows(context: Context) -> dict[str, list[str]]:
    """Every row of every table, as text."""
    with context.store.database.transaction() as connection:
        return {
            table.name: sorted(
                str(row[0]) for row in connection.execute(text(f"SELECT t::text FROM {table} t"))
            )
            for table in metadata.sorted_tables
            if table.name not in MADE_OF_OTHERS
        }


def stored(context: Context) -> dict[str, bytes]:
    return {item.hash: context.artifacts.get(item.hash) for item in context.artifacts.all()}


@pytest.mark.ci
def test_a_restored_service_is_the_one_that_was_backed_up(
    context, submissions, elsewhere, tmp_path
) -> None:
    submit(submissions, SWEEP)
    work(context)
    place = str(tmp_path / "backups")
    made = command(context, "admin", "backup", place, "--json")
    assert made.returncode == 0, made.stderr
    assert json.loads(made.stdout)["copied"] == len(stored(context))
    other = elsewhere()
    restored = command(other, "admin", "restore", place)
    assert restored.returncode == 0, restored.stderr
    assert rows(other) == rows(context)
    assert stored(other) == stored(context)
    before, after = (
        [trial for trial, _ in c.store.results.boards.of_sweep(_sweep(c))] for c in (context, other)
    )
    assert before == after
    assert len(before) == 2
    work(other)  # nothing is left to do there
    assert rows(other)["journal"] == rows(context)["journal"]


def test_a_job_half_way_continues_elsewhere_and_asks_nothing_twice(
    context, submissions, elsewhere, tmp_path
) -> None:
    submit(submissions, {**SWEEP, "models": ["builtin/expert"]})
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


def test_a_second_backup_copies_only_what_is_new(context, submissions, tmp_path) -> None:
    place = str(tmp_path / "b")
    submit(submissions, {**SWEEP, "models": ["builtin/idle"]})
    work(context)
    first = json.loads(command(context, "admin", "backup", place, "--name", "one", "--json").stdout)
    assert first["copied"] == first["artifacts"] > 0
    submit(submissions, {**SWEEP, "models": ["builtin/random"]})
    work(context)
    second = json.loads(
        command(context, "admin", "backup", place, "--name", "two", "--json").stdout
    )
    assert second["artifacts"] > first["artifacts"]
    assert second["copied"] == second["artifacts"] - first["artifacts"]
    listed = json.loads(command(context, "admin", "backup", place, "--list", "--json").stdout)
    assert [backup["name"] for backup in listed] == ["one", "two"]


def test_what_the_store_lost_is_named_and_the_rest_is_saved(context, submissions, tmp_path) -> None:
    submit(submissions, {**SWEEP, "models": ["builtin/expert"]})
    work(context)
    lost, *_ = sorted(stored(context))
    (context.settings.data / "artifacts" / lost[:2] / lost).write_bytes(b"other bytes")
    made = command(context, "admin", "backup", str(tmp_path / "b"))
    assert made.returncode == 3
    assert f"missing or damaged in the store: {lost}" in made.stdout


def test_a_damaged_backup_is_refused_and_the_database_stays_empty(
    context, submissions, elsewhere, tmp_path
) -> None:
    submit(submissions, {**SWEEP, "models": ["builtin/idle"]})
    work(context)
    place = tmp_path / "b"
    assert command(context, "admin", "backup", str(place), "--name", "good").returncode == 0
    other = elsewhere()
    whole = {file: file.read_bytes() for file in place.rglob("*") if file.is_file()}
    for damaged, data in whole.items():
        if damaged.name == "manifest.json":
            continue
        damaged.write_bytes(data[:-1] + b"?")
        refused = command(other, "admin", "restore", str(place))
        assert refused.returncode == 1, damaged
        assert "damaged" in refused.stderr, refused.stderr
        damaged.write_bytes(data)
    assert other.store.database.schema() is None
    assert command(other, "admin", "restore", str(place)).returncode == 0


@pytest.fixture
def place(context, submissions, tmp_path) -> Path:
    """A place with the backup of a service whose one job has ended."""
    submit(submissions, {**SWEEP, "models": ["builtin/expert"]})
    work(context)
    assert command(context, "admin", "backup", str(tmp_path / "b"), "--name", "one").returncode == 0
    return tmp_path / "b"


def trajectory_in(place: Path, context: Context) -> tuple[Path, str]:
    """The file of the job's trajectory in a place of backups, and what it is to the job."""
    (job,) = context.store.jobs.page(limit=10)
    digest = context.store.jobs.artifacts(job.id)["trajectory-0"]
    return place / "artifacts" / digest[:2] / digest, f"{job.id}/trajectory-0"


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("damage", [lambda data: data[:-1] + b"?", lambda data: data + b"?", None])
def test_a_damaged_artifact_is_found_and_copied_again(context, place, damage) -> None:
    file, _ = trajectory_in(place, context)
    whole = file.read_bytes()
    assert command(context, "admin", "backup", str(place), "--check").returncode == 0
    file.unlink() if damage is None else file.write_bytes(damage(whole))
    found = command(context, "admin", "backup", str(place), "--check", "--json")
    assert found.returncode == 3
    assert list(json.loads(found.stdout)["problems"]) == [file.name]
    assert command(context, "admin", "backup", str(place), "--name", "two").returncode == 0
    assert file.read_bytes() == whole
    for name in ("one", "two"):
        assert (
            command(context, "admin", "backup", str(place), "--check", "--name", name).returncode
            == 0
        )


def test_an_artifact_of_another_size_is_copied_again_unasked(context, place) -> None:
    file, _ = trajectory_in(place, context)
    whole = file.read_bytes()
    file.write_bytes(whole[:100])
    made = command(context, "admin", "backup", str(place), "--json")
    assert (made.returncode, json.loads(made.stdout)["copied"]) == (0, 1)
    assert file.read_bytes() == whole


def test_what_is_left_is_restored_and_what_is_lost_named(context, place, elsewhere) -> None:
    file, use = trajectory_in(place, context)
    file.unlink()
    other = elsewhere()
    refused = command(other, "admin", "restore", str(place))
    assert refused.returncode == 1
    assert "--despite-missing" in refused.stderr
    assert other.store.database.schema() is None
    restored = command(other, "admin", "restore", str(place), "--despite-missing")
    assert restored.returncode == 3, restored.stderr
    assert f"lost: artifact {file.name}, {use}" in restored.stdout
    assert rows(other) == rows(context)
    assert set(stored(other)) == set(stored(context)) - {file.name}


def test_a_restore_names_what_was_missing_when_it_was_backed_up(
    context, submissions, elsewhere, tmp_path
) -> None:
    submit(submissions, {**SWEEP, "models": ["builtin/expert"]})
    work(context)
    file, use = trajectory_in(context.settings.data, context)
    file.unlink()
    assert command(context, "admin", "backup", str(tmp_path / "b")).returncode == 3
    restored = command(elsewhere(), "admin", "restore", str(tmp_path / "b"), "--json")
    assert restored.returncode == 3, restored.stderr
    assert json.loads(restored.stdout)["lost"] == {file.name: [use]}


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
        (("restore", place, "--name", "two"), "no whole backup 'two'; the newest are: one"),
        (("restore", str(empty)), "there is no whole backup in"),
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


def _sweep(context: Context) -> str:
    with context.store.database.transaction() as connection:
        return str(connection.execute(text("SELECT id FROM sweeps")).scalar_one())
