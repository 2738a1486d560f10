"""What goes wrong around the embedded Postgres, and what it leaves behind."""

import fcntl
import os
import subprocess
import tempfile
import time
from pathlib import Path

import psycopg
import pytest

from buildarena_cli.local import EmbeddedPostgres
from buildarena_cli.local.postgres import installed_postgres
from buildarena_cli.local.program_copy import PREFIX, ProgramCopy
from buildarena_pipeline.errors import StartupError


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The only folder that copies of the program are made in."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


def left_in(place: Path, name: str, *, age_s: float = 3600.0) -> Path:
    folder = place / f"{PREFIX}{name}"
    (folder / "bin").mkdir(parents=True)
    os.utime(folder, (time.time() - age_s, time.time() - age_s))
    return folder


def test_a_copy_runs_and_is_gone_when_it_is_not_needed_any_more(place) -> None:
    copy = ProgramCopy(installed_postgres(), None, places=())
    initdb = copy.install / "bin" / "initdb"
    done = subprocess.run([initdb, "--version"], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("initdb (PostgreSQL)")
    assert copy.install.is_relative_to(place)
    copy.remove()
    assert list(place.iterdir()) == []


def test_what_a_killed_process_left_is_removed_by_the_next(place) -> None:
    left, used, young = left_in(place, "left"), left_in(place, "used"), left_in(place, "y", age_s=1)
    with (place / PREFIX).open("w") as other:  # a file of another's
        lock = os.open(used, os.O_RDONLY)
        fcntl.flock(lock, fcntl.LOCK_EX)
        ProgramCopy(installed_postgres(), None, places=()).remove()
        os.close(lock)
    assert sorted(place.iterdir()) == sorted([used, young, Path(other.name)])
    assert not left.exists()


def test_a_program_that_can_be_run_from_nowhere_names_the_places(place) -> None:
    broken = place / "package" / "pginstall"
    (broken / "bin").mkdir(parents=True)
    (broken / "bin" / "postgres").write_text("#!/bin/sh\necho libpq is missing >&2; exit 127")
    (broken / "bin" / "postgres").chmod(0o755)
    with pytest.raises(StartupError, match=r"a copy of it from .* \(libpq is missing\): run"):
        ProgramCopy(broken, None, places=())


def test_the_servers_own_reason_is_in_the_message(tmp_path) -> None:
    postgres = EmbeddedPostgres(tmp_path / "pg", tmp_path / "log", durable=False)
    postgres.stop(postgres.start())
    (tmp_path / "pg/cluster/PG_VERSION").write_text("9\n")
    with pytest.raises(StartupError) as refused:
        postgres.start()
    message = str(refused.value)
    assert "postgres ended at once: FATAL:  database files are incompatible with server" in message
    assert "DETAIL:  The data directory was initialized by PostgreSQL version 9" in message
    assert "choose another folder with --data" in message


def test_a_cluster_whose_making_was_interrupted_is_made_anew(tmp_path) -> None:
    half = tmp_path / "pg/cluster.partial"
    half.mkdir(parents=True)
    (half / "PG_VERSION").write_text("18\n")
    postgres = EmbeddedPostgres(tmp_path / "pg", tmp_path / "log", durable=False)
    process = postgres.start()
    with psycopg.connect(postgres.url) as connection:
        assert connection.execute("SELECT 1").fetchone() == (1,)
    postgres.stop(process)
    assert sorted(path.name for path in (tmp_path / "pg").iterdir()) == ["cluster", "password"]
