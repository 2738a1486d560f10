"""Processes that try machines, shared by all rollouts of this program that ask for the same."""

from __future__ import annotations

import asyncio
import atexit
import os
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from buildarena_benchmark.environment import TrialPool

T = TypeVar("T")
Asked = tuple[int | None, float, bool]
"""How many processes, the seconds of a trial, whether trials are whole."""


class TrialRunner:
    """Warm processes, and threads in which rollouts wait for them.

    Args:
        processes: How many; None for one for each core that this process may use.
        timeout_s: Seconds after which a trial is broken off.
        whole: False ends each trial when it is decided, see the environment's `try_machine`.
    """

    def __init__(self, processes: int | None, timeout_s: float, whole: bool) -> None:
        self.pool = TrialPool(processes, timeout_s=timeout_s, whole=whole)
        self._threads = ThreadPoolExecutor(
            len(self.pool.processes), thread_name_prefix="rollouts wait"
        )

    async def run(self, work: Callable[[], T]) -> T:
        """What work that waits for a trial returns; other rollouts go on meanwhile."""
        return await asyncio.get_running_loop().run_in_executor(self._threads, work)

    def close(self) -> None:
        """Ends the processes; trials under way are broken off."""
        self._threads.shutdown(wait=False, cancel_futures=True)
        self.pool.close()
        self._threads.shutdown()


class TrialRunners:
    """The trial runners of a program, by what they were asked for."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._runners: dict[tuple[int, Asked], TrialRunner] = {}
        self._holders: dict[tuple[int, Asked], int] = {}

    def get(self, *asked: *Asked) -> TrialRunner:
        """The runner of this kind; made when it is first asked for."""
        with self._lock:
            return self._got(asked)

    def hold(self, *asked: *Asked) -> None:
        """Keeps a runner until as many releases."""
        key = _key(asked)
        with self._lock:
            self._got(asked)
            self._holders[key] = self._holders.get(key, 0) + 1

    def release(self, *asked: *Asked) -> None:
        """Ends a runner's processes when its last holder releases it."""
        key = _key(asked)
        with self._lock:
            self._holders[key] = self._holders.get(key, 1) - 1
            unused = self._runners.pop(key, None) if self._holders[key] <= 0 else None
            if self._holders[key] <= 0:
                del self._holders[key]
        if unused is not None:
            unused.close()

    def close(self) -> None:
        """Ends all processes of this program."""
        with self._lock:
            mine = [key for key in self._runners if key[0] == os.getpid()]
            unused = [self._runners.pop(key) for key in mine]
        for runner in unused:
            runner.close()

    def _got(self, asked: Asked) -> TrialRunner:
        key = _key(asked)
        if key not in self._runners:
            self._runners[key] = TrialRunner(*asked)
        return self._runners[key]


def _key(asked: Asked) -> tuple[int, Asked]:
    # A forked program must not talk to its parent's processes.
    return os.getpid(), asked


RUNNERS = TrialRunners()
atexit.register(RUNNERS.close)
