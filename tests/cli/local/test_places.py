"""The servers start wherever a clone lies, whoever uses it, and leave nothing behind."""

import signal

import httpx
import pytest
from support.odd_places import Case, run_elsewhere, start_elsewhere

from buildarena_cli.local.server import free_port

LONG = "/".join(["a-folder-with-a-long-name" * 8] * 4)
"""800 characters: what the programs' own paths add stays below Postgres' limit of 1,024."""
CASES = {
    "private folder": Case(),
    "open folder, odd letters": Case(mode=0o755, folder="Übungen für 'später', $1 `each`"),
    "ordinary user": Case(ordinary=True, unset=("HOME", "LANG")),
    "long path": Case(folder=LONG),
    "noexec": Case(noexec=("/tmp",)),
    "read-only checkout": Case(read_only=True),
}
SERVERS = """
import sys
from pathlib import Path
import psycopg
from redis import Redis
from buildarena_cli.local.postgres import EmbeddedPostgres
from buildarena_cli.local.server import EmbeddedValkey

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


@pytest.mark.ci
@pytest.mark.nightly(keep=4)
@pytest.mark.parametrize("name", CASES)
def test_the_servers_start_anywhere(name) -> None:
    printed = run_elsewhere(CASES[name], ["-c", BOTH, "{data}"])
    assert printed.splitlines() == ["42", "True", "", "cluster password"]


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
        "from buildarena_backend.errors import StartupError\n"
        "try:\n    once('SELECT 1')\n"
        "except StartupError as error:\n    print(error)"
    )
    return run_elsewhere(case, ["-c", program, "{data}"])


@pytest.mark.ci
def test_the_whole_service_runs_from_a_read_only_checkout() -> None:
    case = Case(folder="Übungen für später", read_only=True, noexec=("/tmp",), unset=("HOME",))
    port, run = str(free_port()), "from buildarena_cli.main import run; run()"
    with start_elsewhere(case, ["-c", run, "up", "--data", "{data}", "--port", port]) as process:
        try:
            while "Ctrl-C" not in (line := process.stdout.readline()):
                assert line, process.stderr.read()
            health = httpx.get(f"http://127.0.0.1:{port}/v1/health")
            assert health.json()["status"] == "ok"
        finally:
            process.send_signal(signal.SIGTERM)
            process.communicate(timeout=60)
    assert process.returncode == 0
