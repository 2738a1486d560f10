"""Processes that simulate machines, shared by a program's rollouts with the same settings."""

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
RunnerSettings = tuple[int | None, float, bool]
"""Number of processes, timeout of a trial in seconds, and whether trials are complete."""


class TrialRunner:
    """Running processes, and threads in which rollouts wait for them.

    Args:
        processes: Number of processes; None for one for each available core.
        timeout_s: Timeout of a trial, seconds.
        complete: False to end decided trials early, see the environment's `try_machine`.
    """

    def __init__(self, processes: int | None, timeout_s: float, complete: bool) -> None:
        self.pool = TrialPool(processes, timeout_s=timeout_s, to_end=complete)
        self._threads = ThreadPoolExecutor(
            len(self.pool.processes), thread_name_prefix="rollouts wait"
        )

    async def run(self, work: Callable[[], T]) -> T:
        """Return the result of work that waits for a trial, without blocking other rollouts."""
        return await asyncio.get_running_loop().run_in_executor(self._threads, work)

    def close(self) -> None:
        """End the processes and interrupt their trials."""
        self._threads.shutdown(wait=False, cancel_futures=True)
        self.pool.close()
        self._threads.shutdown()


class TrialRunners:
    """Trial runners of a program, by their settings."""

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._runners: dict[tuple[int, RunnerSettings], TrialRunner] = {}
        self._holders: dict[tuple[int, RunnerSettings], int] = {}

    def get(self, *settings: *RunnerSettings) -> TrialRunner:
        """Return the runner with these settings, created at the first call."""
        key = _key(settings)
        with self._lock:
            if key not in self._runners:
                self._runners[key] = TrialRunner(*settings)
            return self._runners[key]

    def hold(self, *settings: *RunnerSettings) -> None:
        """Hold a runner until as many calls of `release`."""
        key = _key(settings)
        with self._lock:
            self.get(*settings)
            self._holders[key] = self._holders.get(key, 0) + 1

    def release(self, *settings: *RunnerSettings) -> None:
        """End a runner's processes when its last holder releases it."""
        key = _key(settings)
        with self._lock:
            self._holders[key] = self._holders.get(key, 1) - 1
            unused = self._runners.pop(key, None) if self._holders[key] <= 0 else None
            if self._holders[key] <= 0:
                del self._holders[key]
        if unused is not None:
            unused.close()

    def close(self) -> None:
        """End all processes of this program."""
        with self._lock:
            mine = [key for key in self._runners if key[0] == os.getpid()]
            unused = [self._runners.pop(key) for key in mine]
        for runner in unused:
            runner.close()


def _key(settings: RunnerSettings) -> tuple[int, RunnerSettings]:
    # A forked program must not use its parent's processes.
    return os.getpid(), settings


RUNNERS = TrialRunners()
atexit.register(RUNNERS.close)
