"""FaultInjector: processes are killed and restarted at random, and messages come twice."""

import contextlib
import math
import os
import random
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Self

import psutil
import structlog
from redis import Redis
from redis.exceptions import RedisError

from buildarena_cli.local.stack import Stack

VICTIMS = ("construct worker", "mujoco worker", "api", "valkey", "postgres")
WORKERS = ("construct worker", "mujoco worker")
QUEUES = ("construct", "simulate.mujoco")

SKEWED = Path(__file__).with_name("skewed.py")
SKEW_HOURS = "3"

log = structlog.get_logger(__name__)


@contextlib.contextmanager
def skewed_worker(environment: dict[str, str], log: Path, *words: str) -> Iterator[None]:
    """A further worker, whose clock is hours ahead."""
    with log.open("ab") as stream:
        process = subprocess.Popen(
            [sys.executable, str(SKEWED), SKEW_HOURS, *words],
            env=environment,
            stdout=stream,
            stderr=stream,
        )
        try:
            yield
        finally:
            process.terminate()
            process.wait(timeout=30)


@dataclass(frozen=True, slots=True)
class Kill:
    """A process that was ended with its children, and when."""

    name: str
    pids: frozenset[int]
    at: datetime


@dataclass
class FaultInjector:
    """Strikes a running stack every now and then, from a thread; use as a context manager."""

    stack: Stack
    rng: random.Random
    every_s: float
    most: float = math.inf
    victims: Sequence[str] = VICTIMS
    kills: list[Kill] = field(default_factory=list)
    duplicates: int = 0
    _stop: threading.Event = field(default_factory=threading.Event)
    _thread: threading.Thread | None = None

    def __enter__(self) -> Self:
        self._thread = threading.Thread(target=self._burn)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def stop(self) -> None:
        """Puts an end to the faults."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join()

    def _burn(self) -> None:
        # Every kind of victim in turn, in an order of chance: none is left out.
        turn: list[str] = []
        while len(self.kills) < self.most:
            if self._stop.wait(self.rng.uniform(0.5, 1.5) * self.every_s):
                return
            self._duplicate()
            if not turn:
                turn = self.rng.sample(self.victims, len(self.victims))
            self._strike(turn.pop())

    def _strike(self, name: str) -> None:
        (managed,) = [m for m in self.stack.supervisor.managed if m.name == name]
        victim = managed.process
        if victim is None or victim.poll() is not None:
            return
        # SIGTERM makes Postgres wait until all who are connected have left.
        gently = signal.SIGINT if name == "postgres" else signal.SIGTERM
        how = signal.SIGKILL if self.rng.random() < 0.75 else gently
        with contextlib.suppress(ProcessLookupError, psutil.NoSuchProcess):
            children = psutil.Process(victim.pid).children(recursive=True)
            pids = frozenset({victim.pid, *(child.pid for child in children)})
            os.kill(victim.pid, how)
            self.kills.append(Kill(name, pids, datetime.now(UTC)))
            log.info("struck", name=name, how=how.name)

    def _duplicate(self) -> None:
        """Sends waiting messages again."""
        environment = self.stack.environment
        try:
            with Redis.from_url(environment["BUILDARENA_BROKER_URL"], socket_timeout=2) as valkey:
                for queue in QUEUES:
                    for message in valkey.lrange(queue, 0, 19):
                        valkey.rpush(queue, message)
                        self.duplicates += 1
        except (RedisError, OSError):
            time.sleep(0.1)
