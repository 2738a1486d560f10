"""People hand in packages while the API is killed again and again: none is lost or twice there."""

import os
import random
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from threading import Event

from sqlalchemy import text
from support.challenge import packed
from support.servers.stacks import wait_until

from buildarena_cli.local import free_port
from buildarena_client import Client, ClientError
from buildarena_store import Database

PACKAGES = int(os.environ.get("CHAOS_PACKAGES", "8"))
PEOPLE = int(os.environ.get("CHAOS_PEOPLE", "4"))
KILLS = int(os.environ.get("CHAOS_KILLS", "1"))
ADMIN = "an operator's secret"
LATER = "UPDATE packages SET claimed_at = claimed_at - interval '1 hour' WHERE state = 'checking'"


@contextmanager
def api(environment: dict[str, str], log: Path) -> Iterator[subprocess.Popen[bytes]]:
    with log.open("ab") as stream:
        process = subprocess.Popen(
            [sys.executable, "-m", "buildarena_api"], env=environment, stdout=stream, stderr=stream
        )
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def handed_in(url: str, key: str, notes: list[str], over: Event) -> int:
    """Hands each in until it was taken; how often that had to be tried."""
    tries = 0
    with Client(url, key=key) as client:
        for note in notes:
            data = packed(note=note)
            while not over.is_set():
                tries += 1
                try:
                    client.submit_package(
                        data, season="s01-stable-orbit", track="autopilot", name=note
                    )
                    break
                except ClientError:
                    time.sleep(0.2)
    return tries


def test_packages_outlive_kills_and_are_checked_once(settings, tmp_path) -> None:
    port = free_port()
    url = f"http://127.0.0.1:{port}"
    environment = {
        **os.environ,
        "BUILDARENA_DATABASE_URL": settings.required_database_url(),
        "BUILDARENA_BROKER_URL": settings.required_broker_url(),
        "BUILDARENA_DATA": str(settings.data),
        "BUILDARENA_PORT": str(port),
        "BUILDARENA_REQUIRE_KEYS": "true",
        "BUILDARENA_ADMIN_KEY": ADMIN,
    }
    rng, log, over = random.Random(os.environ.get("CHAOS_SEED", "1")), tmp_path / "api.log", Event()
    database = Database(settings.required_database_url())
    notes = [f"entry {n}" for n in range(PACKAGES)]

    def rows(query: str) -> list[tuple[object, ...]]:
        with database.transaction() as connection:
            return [tuple(row) for row in connection.execute(text(query))]

    def answers() -> bool:
        try:
            return bool(Client(url, key=ADMIN).seasons())
        except ClientError:
            return False

    with api(environment, log):
        wait_until(answers, 60, "the API answers")
        with Client(url, key=ADMIN) as operator:
            keys = [
                operator.post("/v1/keys", {"name": f"person {n}", "scopes": ["submit"]})["secret"]
                for n in range(PEOPLE)
            ]
    with ThreadPoolExecutor(PEOPLE) as pool:
        tries = [
            pool.submit(handed_in, url, key, notes[n::PEOPLE], over) for n, key in enumerate(keys)
        ]
        try:
            for _ in range(KILLS):
                with api(environment, log) as process:
                    wait_until(answers, 60, "the API answers")
                    time.sleep(rng.uniform(0.5, 3.0))
                    os.kill(process.pid, signal.SIGKILL)
            with api(environment, log):
                wait_until(lambda: all(each.done() for each in tries), 600, "all are handed in")
                with database.transaction() as connection:
                    connection.execute(text(LATER))
                waiting = "SELECT 1 FROM packages WHERE state IN ('received', 'checking')"
                wait_until(lambda: not rows(waiting), 600, "all are checked")
        finally:
            over.set()
    states = Counter(state for (state,) in rows("SELECT state FROM packages"))
    assert states == {"scored": PACKAGES}
    assert sorted(name for (name,) in rows("SELECT name FROM packages")) == sorted(notes)
    assert rows("SELECT count(*) FROM packages WHERE checked_at IS NULL") == [(0,)]
    database.close()
    asked = sum(each.result() for each in tries)
    sys.stdout.write(f"{PACKAGES} packages, {KILLS} kills, {asked} requests by {PEOPLE} keys\n")
