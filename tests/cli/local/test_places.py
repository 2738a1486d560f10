"""The servers start wherever a clone lies, whoever uses it, and leave nothing behind."""

import dataclasses
import signal

import httpx
import pytest
from support.odd_places import Case, run_elsewhere, start_elsewhere

from buildarena_cli.local import free_port

LONG = "/".join(["a-folder-with-a-long-name" * 8] * 4)
"""800 characters: what the programs' own paths add stays below Postgres' limit of 1,024."""
CASES = {
    "open folder": Case(mode=0o755),
    "private folder": Case(),
    "spaces and umlauts": Case(folder="Übungen für 'später'"),
    "long path": Case(folder=LONG),
    "shell's characters": Case(folder="cost $1 `each`"),
    "no HOME": Case(unset=("HOME", "LANG")),
    "TMPDIR set": Case(temporary="my own"),
    "noexec": Case(noexec=("/tmp",)),
    "read-only checkout": Case(read_only=True),
}
SERVERS = """
import sys
from pathlib import Path
import psycopg
from redis import Redis
from buildarena_cli.local import EmbeddedPostgres, EmbeddedValkey

def once(statement):
    postgres = EmbeddedPostgres(data / "postgres", data / "postgres.log", durable=False)
    process = postgres.start()
    try:
        with psycopg.connect(postgres.url) as connection:
            for each in statement.split(";"):
                cursor = connection.execute(each)
            return cursor.fetchone()[0]
    finally:
        postgres.stop(process)

data = Path(sys.argv[1])
"""
BOTH = (
    SERVERS
    + """
print(once("SELECT 40 + 2"))
valkey = EmbeddedValkey(data / "valkey", data / "valkey.log")
process = valkey.start()
with Redis.from_url(valkey.url) as client:
    print(client.ping())
valkey.stop(process)
print(*[path.name for place in ("/tmp", "/var/tmp") for path in Path(place).iterdir()])
print(*sorted(path.name for path in (data / "postgres").iterdir()))
"""
)


FEW = ("private folder", "long path", "noexec", "read-only checkout")


@pytest.mark.ci
@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize(
    ("user", "case"),
    [
        pytest.param(
            *(user, case),
            id=f"{user}-{name}",
            marks=()
            if name in FEW and (user == "root" or name == "private folder")
            else pytest.mark.nightly,
        )
        for user in ("root", "ordinary user")
        for name, case in CASES.items()
    ],
)
def test_the_servers_start_anywhere(case, user) -> None:
    case = dataclasses.replace(case, ordinary=user != "root")
    printed = run_elsewhere(case, ["-c", BOTH, "{data}"])
    assert printed.splitlines() == ["42", "True", "", "cluster password"]


@pytest.mark.ci
def test_root_in_a_container_needs_no_further_privilege() -> None:
    printed = run_elsewhere(Case(contained=True), ["-c", BOTH, "{data}"])
    assert printed.splitlines() == ["42", "True", "", "cluster password"]


@pytest.mark.ci
def test_two_clones_start_side_by_side() -> None:
    second = Case(folder="clone/second")
    both = Case(
        before=(f"mkdir -p {second.clone} {second.data}", f"mount --bind {{clone}} {second.clone}")
    )
    program = """
import os, subprocess, sys
first, second, servers = sys.argv[1:4]
def start(clone, data):
    path = os.environ["PYTHONPATH"].replace(first, clone)
    return subprocess.Popen(
        [f"{clone}/.venv/bin/python", "-c", servers, data], env={**os.environ, "PYTHONPATH": path}
    )
started = [start(first, sys.argv[4]), start(second, sys.argv[5])]
print([process.wait() for process in started])
"""
    servers = SERVERS + "once('SELECT pg_sleep(0.5)')"
    arguments = ["{clone}", str(second.clone), servers, "{data}", str(second.data)]
    assert run_elsewhere(both, ["-c", program, *arguments]) == "[0, 0]\n"


@pytest.mark.ci
def test_postgres_gets_its_own_folder_and_nothing_around_it() -> None:
    program = SERVERS + (
        "(data / 'notes').write_text('for everybody who can enter')\n"
        "print(once(\"SELECT pg_read_file('PG_VERSION')\").strip())\n"
        "try:\n    once(\"SELECT pg_read_file('../../notes')\")\n"
        "except psycopg.Error as error:\n    print(error)"
    )
    version, refusal = run_elsewhere(Case(), ["-c", program, "{data}"]).splitlines()
    assert int(version) >= 16
    assert refusal.endswith("Permission denied")


@pytest.mark.ci
def test_data_that_an_older_version_kept_elsewhere_is_found_again() -> None:
    program = (
        SERVERS
        + """
import hashlib, subprocess
cluster = data / "postgres/cluster"
once("CREATE TABLE kept AS SELECT 7 AS n; SELECT n FROM kept")
former = "/var/tmp/buildarena-postgres-" + hashlib.sha256(str(cluster).encode()).hexdigest()[:16]
subprocess.run(["cp", "-a", cluster, former], check=True)
subprocess.run(["rm", "-r", cluster], check=True)
print(once("SELECT n FROM kept"))
"""
    )
    assert run_elsewhere(Case(), ["-c", program, "{data}"]) == "7\n"


@pytest.mark.ci
def test_a_full_disk_is_named_in_the_message() -> None:
    small = Case(before=("mount -t tmpfs -o mode=755,size=8m none {data}",))
    message = _refusal(small)
    assert message.startswith("Postgres could not make its data folder /mnt/clone/data/postgres")
    assert "No space left on device" in message
    assert "choose another folder with --data" in message


def test_where_no_program_can_be_run_each_place_is_named() -> None:
    places = ("/tmp", "/var/tmp", "/var/cache", "/var/lib", "/run", "/dev/shm")
    message = _refusal(Case(noexec=places))
    for place in places:
        assert f"{place} (mounted noexec)" in message
    assert "chmod o+x" in message


def _refusal(case: Case) -> str:
    program = SERVERS + (
        "from buildarena_pipeline.errors import StartupError\n"
        "try:\n    once('SELECT 1')\n"
        "except StartupError as error:\n    print(error)"
    )
    return run_elsewhere(case, ["-c", program, "{data}"])


@pytest.mark.ci
def test_the_suite_itself_runs_in_a_private_clone() -> None:
    case = Case(noexec=("/tmp",), folder="Übungen für später", unset=("HOME",))
    few = f"{case.clone}/tests/store/test_keys.py"
    options = [f"--rootdir={case.clone}", f"-c{case.clone}/pyproject.toml", "-pno:cacheprovider"]
    printed = run_elsewhere(case, ["-m", "pytest", *options, few])
    assert "passed" in printed


@pytest.mark.ci
def test_the_whole_service_runs_from_a_read_only_checkout_without_pybullet() -> None:
    case = Case(folder="Übungen für später", read_only=True, noexec=("/tmp",), unset=("HOME",))
    port = str(free_port())
    case = dataclasses.replace(case, hidden="pybullet")
    run = "from buildarena_cli.main import run; run()"
    with start_elsewhere(case, ["-c", run, "up", "--data", "{data}", "--port", port]) as process:
        try:
            printed = ""
            while "Ctrl-C" not in printed:
                line = process.stdout.readline()
                assert line, process.stderr.read()
                printed += line
            assert "the default engine 'pybullet' is not installed" in printed
            assert "submissions must name one" in printed
            with httpx.Client(base_url=f"http://127.0.0.1:{port}/v1") as api:
                assert api.get("/health").json()["status"] == "ok"
                sweep = {"tasks": ["support-1"], "models": ["builtin/idle"], "seeds": [0]}
                made = api.post("/sweeps", json={**sweep, "simulator": "mujoco"})
                assert made.status_code == 202, made.text
                for refused in (sweep, {**sweep, "simulator": "pybullet"}):
                    answer = api.post("/sweeps", json=refused)
                    assert answer.status_code == 422
                    assert answer.json()["errors"][0]["choices"] == ["mujoco"]
        finally:
            process.send_signal(signal.SIGTERM)
            process.communicate(timeout=60)
    assert process.returncode == 0


@pytest.mark.ci
def test_a_read_only_checkout_without_a_data_folder_is_refused_in_words() -> None:
    run = "import os, sys; os.chdir(sys.argv.pop(1)); from buildarena_cli.main import run; run()"
    with start_elsewhere(Case(read_only=True), ["-c", run, "{clone}", "demo"]) as process:
        _, errors = process.communicate(timeout=60)
    assert process.returncode == 1
    assert "can't be written (Read-only file system)" in " ".join(errors.split())
    assert "--data" in errors
