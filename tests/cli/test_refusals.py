"""What cannot work is refused with one clear sentence, the right exit code and nothing left."""

import os
import socket
import subprocess
import sys

import psutil
import pytest
from support.clients.terminals import piped


def assert_refused(done: subprocess.CompletedProcess[str], *words: str) -> None:
    assert done.returncode == 1, (done.stdout, done.stderr)
    (line,) = done.stderr.strip().splitlines()
    for word in words:
        assert word in line


@pytest.mark.ci
def test_a_taken_port(tmp_path, subtests) -> None:
    for command in ["up", "demo"]:
        with subtests.test(command=command):
            with socket.socket() as taken:
                taken.bind(("127.0.0.1", 0))
                taken.listen()
                port = str(taken.getsockname()[1])
                done = piped(command, "--data", str(tmp_path), "--port", port)
            assert_refused(done, port, "choose another port with --port")
            named = [
                p
                for p in psutil.process_iter(["cmdline"])
                if str(tmp_path) in str(p.info["cmdline"])
            ]
            assert named == []


@pytest.mark.ci
def test_an_unwritable_data_folder(tmp_path, subtests) -> None:
    for command in ["up", "demo"]:
        with subtests.test(command=command):
            (tmp_path / "file").write_text("in the way")
            done = piped(command, "--data", str(tmp_path / "file" / "data"))
            assert_refused(done, "can't be written", "choose another with --data")


@pytest.mark.ci
def test_a_data_folder_in_use(tmp_path) -> None:
    import fcntl

    (tmp_path / "lock").touch()
    with (tmp_path / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        done = piped("up", "--data", str(tmp_path), "--port", "0")
    assert_refused(done, "another BuildArena runs on the data folder")


def test_a_service_that_is_not_there() -> None:
    done = piped("leaderboard", "--url", "http://127.0.0.1:1")
    assert_refused(done, "no BuildArena answers at http://127.0.0.1:1", "buildarena up")


def test_a_port_that_is_no_port() -> None:
    done = piped("up", BUILDARENA_PORT="99999")
    assert_refused(done, "BUILDARENA_PORT", "99999")


@pytest.mark.ci
@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize(
    ("text", "code", "says"),
    [("tasks: [", 1, "not valid YAML"), ("- 1", 1, "must be a mapping"), (None, 2, "No such")],
)
def test_a_bad_sweep_file(tmp_path, text, code, says) -> None:
    file = tmp_path / "sweep.yaml"
    if text is not None:
        file.write_text(text)
    done = piped("sweep", "run", str(file), "--url", "http://127.0.0.1:1")
    assert done.returncode == code
    assert says in done.stderr


@pytest.mark.nightly(keep=2)
@pytest.mark.parametrize("words", [["fly"], ["job"], ["job", "show"], ["leaderboard", "--fast"]])
def test_wrong_words_end_with_code_2(words) -> None:
    assert piped(*words).returncode == 2


def test_help_names_every_command() -> None:
    text = piped("--help").stdout
    for command in ("up", "demo", "doctor", "sweep", "job", "leaderboard"):
        assert command in text


@pytest.mark.ci
@pytest.mark.parametrize("module", ["buildarena_worker", "buildarena_api"])
def test_a_process_refuses_a_foreign_schema(database_url, broker_url, module) -> None:
    from buildarena_store import Database
    from buildarena_store.database import SCHEMA

    database = Database(database_url)

    def stamp(revision: str) -> None:
        with database.transaction() as connection:
            connection.exec_driver_sql(f"UPDATE alembic_version SET version_num = '{revision}'")
            connection.exec_driver_sql(f"UPDATE schema_compatibility SET since = '{revision}'")

    stamp("2026_11_27_what_goes")
    try:
        done = subprocess.run(
            [sys.executable, "-m", module],
            capture_output=True,
            text=True,
            check=False,
            timeout=60,
            env={
                **os.environ,
                "BUILDARENA_DATABASE_URL": database_url,
                "BUILDARENA_BROKER_URL": broker_url,
            },
        )
        assert done.returncode == 1
        assert "schema 2026_11_27_what_goes" in done.stderr
    finally:
        stamp(SCHEMA)
        database.close()
