"""Two of something: two API processes of one service, and a backup beside what it is taken of."""

import os
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress

import httpx
import psutil
from scenarios.attack.arena import Arena, Tried
from sqlalchemy import create_engine, text
from support.clients.tenants import everything, new_tenant
from support.servers.api_process import answers
from support.servers.stacks import wait_until

from buildarena_backend.database.database import Database
from buildarena_cli.local.server import free_port

REVOKED_S = 1.0
"""Within so long every process refuses a key that another revoked."""
BUSY = ("workers", "verifications")
"""Tables that a service writes without being asked."""


def two_processes(arena: Arena) -> Tried:
    """The same submission to two API processes at once, keys revoked at the other one."""
    found = Tried("a second API process: equal submissions at once, revoked keys, boards")
    with _second_api(arena) as url:
        submissions = [arena.stack.url, url] * 10
        spec = {"tasks": ["support-1"], "models": ["builtin/idle"], "seeds": [8000, 8001]}

        def submit(at: str) -> str:
            headers = {
                "Authorization": f"Bearer {arena.attacker.secret}",
                "Idempotency-Key": "the same of both",
            }
            answer = httpx.post(f"{at}/v1/sweeps", json=spec, headers=headers, timeout=60)
            return str(answer.json().get("id", answer.status_code))

        with ThreadPoolExecutor(len(submissions)) as threads:
            ids = Counter(threads.map(submit, submissions))
        found.require(len(ids) == 1, f"one submission became {dict(ids)}")
        slowest = 0.0
        for _ in range(5):
            tenant = new_tenant(arena.operator.client, "short-lived")
            asked = {"Authorization": f"Bearer {tenant.secret}"}
            assert httpx.get(f"{url}/v1/jobs", headers=asked).is_success
            arena.operator.post(f"/v1/keys/{tenant.id}/revoke")
            started = time.monotonic()
            wait_until(
                lambda: httpx.get(f"{url}/v1/jobs", headers=asked).status_code == 401,
                10,
                "the key is refused",
            )
            slowest = max(slowest, time.monotonic() - started)
        found.require(slowest < REVOKED_S, f"a revoked key worked for {slowest:.1f} s")
        (sweep,) = ids
        wait_until(
            lambda: arena.operator.get(f"/v1/sweeps/{sweep}")["progress"]["done"] == 2,
            60,
            "the sweep ends",
        )
        admin = {"Authorization": f"Bearer {arena.operator.secret}"}
        boards = [
            httpx.get(f"{at}/v1/leaderboard", headers=admin).json()["tasks"]
            for at in (url, arena.stack.url)
        ]
        found.require(boards[0] == boards[1], "two processes show different boards")
        found.refused = (
            f"{sum(ids.values())} submissions made one sweep; a revoked key worked for "
            f"{slowest * 1000:.0f} ms at the other; equal boards"
        )
    return found


def backups_during_kills(arena: Arena) -> Tried:
    """Backups while workers are killed; the last one, restored, is row by row what was there."""
    kills = int(arena.sizes["kills"])
    found = Tried(f"backups while workers are killed {kills} times, and a restore")
    body = {"tasks": ["support-1"], "models": ["builtin/random"], "samples": 4 * kills}
    sweep = arena.innocent.post("/v1/sweeps", {**body, "simulator": "mujoco"})["id"]
    with tempfile.TemporaryDirectory(prefix="buildarena-attack-") as folder:
        place = f"{folder}/backups"
        stopped = threading.Event()
        statuses: list[int] = []

        def back_up() -> None:
            while not stopped.is_set():
                statuses.append(_command(arena, "admin", "backup", place).returncode)

        thread = threading.Thread(target=back_up)
        thread.start()
        try:
            for number in range(kills):
                _kill(arena, ("construct worker", "mujoco worker")[number % 2])
                time.sleep(2)
            wait_until(
                lambda: arena.innocent.get(f"/v1/sweeps/{sweep}")["progress"]["done"] == 4 * kills,
                240,
                "the sweep ends all the same",
            )
        finally:
            stopped.set()
            thread.join()
        found.require(set(statuses) == {0}, f"backups ended with {Counter(statuses)}")
        _settled(arena)
        checked = _command(arena, "admin", "backup", place)
        found.require(checked.returncode == 0, checked.stderr[-300:])
        with _empty_database(arena) as other:
            there = {"BUILDARENA_DATABASE_URL": other, "BUILDARENA_DATA": f"{folder}/there"}
            restored = _command(arena, "admin", "restore", place, **there)
            found.require(restored.returncode == 0, restored.stderr[-300:])
            database = Database(other)
            try:
                rows, copied = everything(arena.database), everything(database)
            finally:
                database.close()
        differing = [name for name in rows if name not in BUSY and rows[name] != copied[name]]
        found.require(not differing, f"restored tables differ: {differing}")
        number = sum(map(len, copied.values()))
        found.refused = f"{len(statuses)} backups, all whole; {number:,} rows restored, all equal"
    return found


@contextmanager
def _second_api(arena: Arena) -> Iterator[str]:
    port = free_port()
    environment = {**arena.stack.environment, "BUILDARENA_PORT": str(port)}
    url = f"http://127.0.0.1:{port}"
    words = [sys.executable, "-m", "buildarena_api"]
    with subprocess.Popen(words, env=environment, stdout=-3, stderr=-3) as process:
        try:
            wait_until(lambda: answers(url, {200, 503}), 60, "the second API answers")
            yield url
        finally:
            process.terminate()


def _command(arena: Arena, *words: str, **more: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, **arena.stack.environment, **more}
    command = [sys.executable, "-m", "buildarena_cli", *words]
    return subprocess.run(
        command, env=environment, capture_output=True, text=True, check=False, timeout=300
    )


def _kill(arena: Arena, name: str) -> None:
    with suppress(psutil.Error, AssertionError):
        process = arena.process(name)
        for child in [*process.children(recursive=True), process]:
            child.kill()


def _settled(arena: Arena) -> None:
    """Waits until the service writes nothing any more."""
    before = None
    for _ in range(30):
        now = {k: v for k, v in everything(arena.database).items() if k not in BUSY}
        if now == before:
            return
        before = now
        time.sleep(2)


@contextmanager
def _empty_database(arena: Arena) -> Iterator[str]:
    url, name = arena.stack.environment["BUILDARENA_DATABASE_URL"], "restored"
    admin = create_engine(
        url.replace("postgresql://", "postgresql+psycopg://"), isolation_level="AUTOCOMMIT"
    )
    with admin.connect() as connection:
        connection.execute(text(f"CREATE DATABASE {name}"))
    try:
        yield f"{url.rsplit('/', 1)[0]}/{name}"
    finally:
        with admin.connect() as connection:
            connection.execute(text(f"DROP DATABASE {name} WITH (FORCE)"))
        admin.dispose()
