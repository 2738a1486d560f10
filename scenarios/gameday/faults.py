"""The faults of a game day: how each begins and ends, and what an operator must be told of it."""

import os
import shutil
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from scenarios.chaos.faults import skewed_worker
from support.servers.flaky_proxy import flaky_proxy
from support.servers.stacks import hung, kill, without_store

from buildarena_cli.local.stack import Stack

ENGINE: Final = "mujoco"
RESERVED_BYTES: Final = 256 * 2**20
"""What a full disk has left."""
SLOW_S: Final = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """Something that goes wrong for some time.

    Attributes:
        name: What it is.
        at_min: When it begins, minutes of the hour.
        lasts_min: How long it lasts.
        alert: What operators must hear; None where the service mends itself unheard.
        over_min: How long after its end the alert may last; None where it looks back for long.
        during: The fault, for as long as this is open.
    """

    name: str
    at_min: float
    lasts_min: float
    alert: str | None
    over_min: float | None = 6.0
    during: Callable[[Stack], AbstractContextManager[None]]


def killed(
    name: str, times: int = 1, every_s: float = 20.0
) -> Callable[[Stack], AbstractContextManager[None]]:
    """A process that is killed, once or again and again."""

    @contextmanager
    def during(stack: Stack) -> Iterator[None]:
        over = threading.Event()

        def strike() -> None:
            for _ in range(times):
                kill(stack, name)
                if over.wait(every_s):
                    return

        thread = threading.Thread(target=strike)
        thread.start()
        try:
            yield
        finally:
            over.set()
            thread.join()

    return during


def hanging(name: str) -> Callable[[Stack], AbstractContextManager[None]]:
    """A process that takes connections and does nothing."""
    return lambda stack: hung(stack, name)


@contextmanager
def full_disk(stack: Stack) -> Iterator[None]:
    """Somebody else's file fills the disk but for a little."""
    filler = stack.settings.data.absolute() / "filler"
    free = shutil.disk_usage(filler.parent).free
    with filler.open("wb") as file:
        os.posix_fallocate(file.fileno(), 0, max(1, free - RESERVED_BYTES))
    try:
        yield
    finally:
        filler.unlink()


def wrong_clock(stack: Stack) -> AbstractContextManager[None]:
    """A further worker whose clock is hours ahead."""
    return skewed_worker(stack.environment, stack.logs / "gameday.log", "buildarena_worker")


@contextmanager
def slow_network(stack: Stack) -> Iterator[None]:
    """A runner whose connections take seconds to answer, and lose some of the answers."""
    ours = {name: value for name, value in os.environ.items() if "BUILDARENA" not in name}
    with flaky_proxy(stack.url) as proxy:
        proxy.delay_s, proxy.swallow_answers, proxy.silent = SLOW_S, 10, 2
        words = ["-m", "buildarena_simworker", "--simulator", ENGINE, "--api", proxy.url]
        with (stack.logs / "gameday.log").open("ab") as log:
            process = subprocess.Popen(
                [sys.executable, *words], env=ours, stdout=log, stderr=log, cwd="/"
            )
            try:
                yield
            finally:
                process.terminate()
                process.wait(timeout=60)


@contextmanager
def lost_messages(stack: Stack) -> Iterator[None]:
    """The broker ends, and what it kept is gone."""
    for file in Path(stack.settings.data, "valkey").glob("*.rdb"):
        with suppress(FileNotFoundError):
            file.unlink()
    kill(stack, "valkey")
    yield


FAULTS: Final = (
    Fault(name="the API is killed", at_min=1, lasts_min=1, alert=None, during=killed("api")),
    Fault(name="the API hangs", at_min=4, lasts_min=4, alert="ApiDown", during=hanging("api")),
    Fault(
        name="a construct worker is killed six times",
        at_min=9,
        lasts_min=8,
        alert="WorkersLost",
        over_min=None,  # an hour back
        during=killed("construct worker", times=6),
    ),
    Fault(
        name="the broker loses its messages",
        at_min=11,
        lasts_min=1,
        alert=None,
        during=lost_messages,
    ),
    Fault(
        name="the broker hangs",
        at_min=14,
        lasts_min=4,
        alert="BrokerDown",
        during=hanging("valkey"),
    ),
    Fault(
        name="a worker's clock is three hours ahead",
        at_min=19,
        lasts_min=8,
        alert="ClockWrong",
        during=wrong_clock,
    ),
    Fault(
        name="the database is killed", at_min=22, lasts_min=1, alert=None, during=killed("postgres")
    ),
    Fault(
        name="the database hangs",
        at_min=29,
        lasts_min=3,
        alert="DatabaseDown",
        during=hanging("postgres"),
    ),
    Fault(
        name="the store of artifacts takes nothing",
        at_min=34,
        lasts_min=4,
        alert="ArtifactStoreDown",
        during=without_store,
    ),
    Fault(
        name="the simulation worker hangs",
        at_min=40,
        lasts_min=8,
        alert="NoWorkers",
        during=hanging(f"{ENGINE} worker"),
    ),
    Fault(name="the disk is full", at_min=50, lasts_min=3, alert="DiskFull", during=full_disk),
    Fault(
        name="a runner's network is slow", at_min=54, lasts_min=4, alert=None, during=slow_network
    ),
)
