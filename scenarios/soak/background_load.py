"""Whoever else is there during a soak: honest runners, liars, noise, strangers without a key."""

import random
import subprocess
import sys
import threading
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

import httpx
import psutil
from scenarios.attack import raw_client
from scenarios.attack.raw_client import ENGINE, RUNNER, beat
from support.clients.tenants import Tenant
from support.servers.lies import LIES, Lie
from support.servers.runner_rig import Caller

from buildarena_backend.database.database import Database

BUILDARENA = str(Path(sys.executable).parent / "buildarena")
TASK = "lift-1"
ACT_EVERY_S = 5.0
STRANGERS = 40
NOISE_BYTES = 2_000_000
LIED = tuple(
    LIES[name] for name in ("poses held from instant 5", "blocks +50 along z", "no ground")
)
"""Lies about any trial of a machine with joints."""


def new_runner(url: str, operator: Tenant) -> Caller:
    """A runner with a key of its own, spoken by hand."""
    key = operator.post("/v1/keys", RUNNER)
    return Caller(url, key["secret"], name=f"soak-{key['id']}")


@contextmanager
def honest_runner(url: str, operator: Tenant, folder: Path) -> Iterator[psutil.Process]:
    """A real runner of our program with a key of its own."""
    folder.mkdir()
    (folder / "key").write_text(operator.post("/v1/keys", RUNNER)["secret"])
    words = ["admin", "worker", f"simulate.{ENGINE}", "--api", url, "--key-file"]
    with (folder / "runner.log").open("ab") as log:
        command = [BUILDARENA, *words, str(folder / "key")]
        process = subprocess.Popen(command, stdout=log, stderr=log, cwd=folder)
    children: Sequence[psutil.Process] = ()
    try:
        yield psutil.Process(process.pid)
    finally:
        with suppress(psutil.Error):
            children = psutil.Process(process.pid).children(recursive=True)
        process.terminate()
        process.wait(60)
        for left in psutil.wait_procs(children, timeout=6)[1]:
            left.kill()


class BackgroundLoad(threading.Thread):
    """Lies, makes noise and stalls, in turns; restarts a runner that it kills.

    Args:
        url: An API.
        operator: Who makes keys for it.
        folder: Where its runner's files go.

    Attributes:
        answers: Answers by what was tried and their status.
    """

    def __init__(self, url: str, operator: Tenant, folder: Path) -> None:
        super().__init__(name="crowd")
        self.answers: Counter[str] = Counter()
        self._url, self._operator, self._folder = url, operator, folder
        self._rng, self._stop_now = random.Random(2), threading.Event()

    def run(self) -> None:
        turns = (self._lie, self._make_noise, self._stall, self._kill_a_runner)
        number = 0
        with ExitStack() as self._runner:
            while not self._stop_now.wait(ACT_EVERY_S):
                # The database and the broker are killed meanwhile: who is refused for that goes on.
                try:
                    turns[number % len(turns)](number)
                except (AssertionError, OSError, httpx.HTTPError, subprocess.SubprocessError):
                    self.answers[f"{turns[number % len(turns)].__name__[1:]}: cut short"] += 1
                number += 1

    def stop(self) -> None:
        """Ends it, and the runner that it kills."""
        self._stop_now.set()
        self.join()

    def _lie(self, number: int) -> None:
        lie: Lie = LIED[number // 4 % len(LIED)]
        liar = new_runner(self._url, self._operator)
        lease = raw_client.leased(liar)
        if lease is not None:
            answer = raw_client.brought(liar, lease, TASK, lie)
            self.answers[f"lie: {answer.status_code}"] += 1

    def _make_noise(self, number: int) -> None:
        noisy = new_runner(self._url, self._operator)
        large = b'{"name": "%s"}' % (b"x" * NOISE_BYTES)
        for name in range(10):
            self.answers[f"2 MB: {raw_client.asked(noisy, content=large)}"] += 1
            answer = raw_client.asked(noisy, json=beat(f"noisy-{number}-{name}"))
            self.answers[f"heartbeat: {answer}"] += 1

    def _stall(self, _number: int) -> None:
        with ExitStack() as connections:
            for _ in range(STRANGERS):
                connections.enter_context(raw_client.stalled(self._url))
            self._stop_now.wait(ACT_EVERY_S)
        self.answers["stalled"] += STRANGERS

    def _kill_a_runner(self, number: int) -> None:
        self._runner.close()
        runner = honest_runner(self._url, self._operator, self._folder / f"runner-{number}")
        process = self._runner.enter_context(runner)
        self._runner.callback(_kill, process)


def refuted(database: Database) -> list[str]:
    """Jobs whose scores were refuted."""
    with database.transaction() as connection:
        query = "SELECT id FROM jobs WHERE audit = 'refuted' AND state = 'done'"
        return [str(id_) for id_ in connection.exec_driver_sql(query).scalars()]


def suspended(database: Database) -> int:
    """How many keys were suspended for a lie."""
    with database.transaction() as connection:
        query = "SELECT count(*) FROM api_keys WHERE suspended_at IS NOT NULL"
        return int(connection.exec_driver_sql(query).scalar_one())


def _kill(process: psutil.Process) -> None:
    with suppress(psutil.Error):
        process.kill()
