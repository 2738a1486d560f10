"""The embedded servers: started again, given up, stopped for good, and what they leave behind."""

import fcntl
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import psutil
import psycopg
import pytest
from redis import Redis
from support.programs import captured
from support.servers.stacks import wait_until

from buildarena_backend.errors import StartupError
from buildarena_cli.local.postgres import EmbeddedPostgres, installed_postgres
from buildarena_cli.local.program_copy import PREFIX, ProgramCopy
from buildarena_cli.local.server import EmbeddedValkey
from buildarena_cli.local.supervisor import ManagedProcess, Supervisor


def python(*words: str, **more: object) -> subprocess.Popen[bytes]:
    return subprocess.Popen([sys.executable, "-c", *words], **more)  # type: ignore[call-overload]


def sleeper() -> subprocess.Popen[bytes]:
    return python("import time; time.sleep(60)")


@pytest.mark.ci
def test_a_killed_broker_is_started_again_with_its_data(tmp_path) -> None:
    valkey = EmbeddedValkey(tmp_path / "valkey", tmp_path / "log")
    managed = ManagedProcess(name="valkey", start=valkey.start, stop=valkey.stop)
    with Supervisor() as supervisor, Redis.from_url(valkey.url, retry=None) as client:
        supervisor.launch(managed)
        supervisor.watch()
        client.set("k", "v")
        time.sleep(1.2)  # appendfsync everysec
        first = managed.process
        first.kill()
        wait_until(lambda: managed.process is not first, 10, "it is started again")
        assert client.get("k") == b"v"
        pid = managed.process.pid
    assert not psutil.pid_exists(pid)


@pytest.mark.ci
def test_a_process_that_keeps_dying_is_given_up() -> None:
    with Supervisor() as supervisor:
        mayfly = ManagedProcess(name="mayfly", start=lambda: python("raise SystemExit(3)"))
        supervisor.launch(mayfly)
        supervisor.watch()
        wait_until(lambda: supervisor.failed is not None, 10, "it is given up")
    assert "mayfly died 6 times" in supervisor.failed
    assert "exit code 3" in supervisor.failed


@pytest.fixture
def started() -> Iterator[list[subprocess.Popen[bytes]]]:
    """What a test starts; whatever happens, nothing of it is left."""
    processes: list[subprocess.Popen[bytes]] = []
    yield processes
    for process in processes:
        process.kill()
        process.wait()


def test_what_is_started_again_while_all_is_stopped_is_stopped_too(started) -> None:
    restarting, stopping = threading.Event(), threading.Event()

    def start() -> subprocess.Popen[bytes]:
        if started:
            restarting.set()
            assert stopping.wait(timeout=10)
            time.sleep(0.3)  # long enough for a stop that does not wait to be over
        started.append(sleeper())
        return started[-1]

    with Supervisor() as supervisor:
        supervisor.launch(ManagedProcess(name="slow", start=start))
        supervisor.watch()
        started[0].kill()
        assert restarting.wait(timeout=10)
        stopping.set()
    assert [process.returncode for process in started] == [-signal.SIGKILL, -signal.SIGTERM]


def test_a_server_that_ends_at_once_says_why(tmp_path) -> None:
    valkey = EmbeddedValkey(tmp_path / "valkey", tmp_path / "log")
    process = valkey.start()
    try:
        with pytest.raises(StartupError, match="valkey ended at once"):
            valkey.start()  # its port is taken
    finally:
        valkey.stop(process)
    half = tmp_path / "pg/cluster.partial"  # of a set-up that was interrupted
    half.mkdir(parents=True)
    (half / "PG_VERSION").write_text("18\n")
    postgres = EmbeddedPostgres(tmp_path / "pg", tmp_path / "log", durable=False)
    process = postgres.start()
    with psycopg.connect(postgres.url) as connection:
        assert connection.execute("SELECT 1").fetchone() == (1,)
    postgres.stop(process)
    assert sorted(path.name for path in (tmp_path / "pg").iterdir()) == ["cluster", "password"]
    cluster = tmp_path / "pg/cluster"
    if os.geteuid() == 0:  # copied by root, it belongs to root
        account = cluster.stat().st_uid
        os.chown(cluster, 0, 0)
        with pytest.raises(StartupError, match=f"belongs to user 0.*: chown -R {account} "):
            postgres.start()
        os.chown(cluster, account, -1)
    (cluster / "PG_VERSION").write_text("9\n")
    with pytest.raises(StartupError) as refused:
        postgres.start()
    for said in (
        "postgres ended at once: FATAL:  database files are incompatible with server",
        "DETAIL:  The data directory was initialized by PostgreSQL version 9",
        "choose another folder with --data",
    ):
        assert said in str(refused.value)


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The only folder that copies of the program are made in."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


def test_a_copy_runs_and_is_gone_with_what_a_killed_process_left(place) -> None:
    for name, age_s in (("left", 3600), ("used", 3600), ("young", 1)):
        folder = place / f"{PREFIX}{name}"
        (folder / "bin").mkdir(parents=True)
        os.utime(folder, (time.time() - age_s, time.time() - age_s))
    lock = os.open(place / f"{PREFIX}used", os.O_RDONLY)
    fcntl.flock(lock, fcntl.LOCK_EX)
    copy = ProgramCopy(installed_postgres(), None, places=())
    assert copy.install.is_relative_to(place)
    initdb = [copy.install / "bin" / "initdb", "--version"]
    done = captured(initdb)
    assert done.stdout.startswith("initdb (PostgreSQL)")
    copy.remove()
    os.close(lock)
    assert {path.name for path in place.iterdir()} == {f"{PREFIX}used", f"{PREFIX}young"}


def test_a_program_that_can_be_run_from_nowhere_names_the_places(place) -> None:
    broken = place / "package" / "pginstall"
    (broken / "bin").mkdir(parents=True)
    (broken / "bin" / "postgres").write_text("#!/bin/sh\necho libpq is missing >&2; exit 127")
    (broken / "bin" / "postgres").chmod(0o755)
    with pytest.raises(StartupError, match=r"a copy of it from .* \(libpq is missing\): run"):
        ProgramCopy(broken, None, places=())
