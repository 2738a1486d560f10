"""People hand in packages while all processes are killed: none is lost or twice there."""

import os
import random
import sys
import tempfile
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path
from threading import Event

import pytest
from scenarios.chaos.faults import Fire
from sqlalchemy import text
from sqlalchemy.exc import DBAPIError
from support.challenge import packed
from support.servers.stacks import running_stack, wait_until

from buildarena_client import Client, ClientError
from buildarena_store import Database

PACKAGES = int(os.environ.get("CHAOS_PACKAGES", "8"))
PEOPLE = int(os.environ.get("CHAOS_PEOPLE", "4"))
KILLS = int(os.environ.get("CHAOS_KILLS", "4"))
ADMIN = "an operator's secret"
EVERY_S = float(os.environ.get("CHAOS_EVERY_S", "2.5"))
STRUCK = ("api", "valkey", "postgres", "construct worker")
LATER = """
    WITH freed AS (
        UPDATE packages SET claimed_at = claimed_at - interval '1 hour' WHERE state = 'checking'
    )
    SELECT 1 WHERE false
"""


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


@pytest.mark.nightly
@pytest.mark.timeout(3600)
def test_packages_outlive_kills_and_are_checked_once() -> None:
    notes, over = [f"entry {n}" for n in range(PACKAGES)], Event()
    with (
        tempfile.TemporaryDirectory(prefix="buildarena-chaos-") as folder,
        running_stack(Path(folder), simulators=(), require_keys=True, admin_key=ADMIN) as stack,
        closing(Database(stack.environment["BUILDARENA_DATABASE_URL"])) as database,
    ):

        def rows(query: str) -> list[tuple[object, ...]]:
            try:
                with database.transaction() as connection:
                    return [tuple(row) for row in connection.execute(text(query))]
            except DBAPIError:  # it was just killed
                return [("not known",)]

        with Client(stack.url, key=ADMIN) as operator:
            keys = [
                operator.post("/v1/keys", {"name": f"person {n}", "scopes": ["submit"]})["secret"]
                for n in range(PEOPLE)
            ]
        fire = Fire(
            stack=stack,
            rng=random.Random(os.environ.get("CHAOS_SEED", "1")),
            every_s=EVERY_S,
            most=KILLS,
            victims=STRUCK,
        )
        with ThreadPoolExecutor(PEOPLE) as pool, fire:
            tries = [
                pool.submit(handed_in, stack.url, key, notes[n::PEOPLE], over)
                for n, key in enumerate(keys)
            ]
            try:
                wait_until(lambda: len(fire.strikes) == KILLS, 1800, "all were struck")
                wait_until(lambda: all(each.done() for each in tries), 1200, "all are handed in")
                wait_until(lambda: rows(LATER) == [], 60, "what dead processes had is free")
                waiting = "SELECT 1 FROM packages WHERE state IN ('received', 'checking')"
                wait_until(lambda: not rows(waiting), 1200, "all are checked")
            finally:
                over.set()
        states = Counter(state for (state,) in rows("SELECT state FROM packages"))
        assert states == {"scored": PACKAGES}
        assert sorted(name for (name,) in rows("SELECT name FROM packages")) == sorted(notes)
        assert rows("SELECT count(*) FROM packages WHERE checked_at IS NULL") == [(0,)]
    asked = sum(each.result() for each in tries)
    struck = dict(Counter(strike.name for strike in fire.strikes))
    sys.stdout.write(f"{PACKAGES} packages, {struck}, {asked} requests by {PEOPLE} keys\n")
