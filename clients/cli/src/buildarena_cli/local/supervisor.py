"""The supervisor, which starts processes in order, restarts those that die, and stops all."""

from __future__ import annotations

import contextlib
import signal
import subprocess
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Self

import structlog

from buildarena_backend.errors import StartupError
from buildarena_cli.local.server import stop_process

log = structlog.get_logger(__name__)

DEATHS_ALLOWED = 5
"""A process that dies more often than this within DEATHS_WITHIN_S is not started again."""
DEATHS_WITHIN_S = 30.0
LOOK_EVERY_S = 0.2


@dataclass(slots=True, kw_only=True)
class ManagedProcess:
    """A process that should run.

    Attributes:
        name: Name for logs and messages.
        start: Starts the process and waits until it is ready.
        stop: Stops the process; None for programs that stop on SIGTERM.
        process: The running process, if any.
        deaths: Times of its unexpected ends.
    """

    name: str
    start: Callable[[], subprocess.Popen[bytes]]
    stop: Callable[[subprocess.Popen[bytes]], None] | None = None
    process: subprocess.Popen[bytes] | None = None
    deaths: deque[float] = field(default_factory=deque)


class Supervisor:
    """Supervisor of processes. Use as a context manager: leaving it stops them all.

    Args:
        stop_within_s: Seconds after which programs that were asked to stop are killed.
        on_change: Called when a process was started, or is given up.
    """

    def __init__(
        self, *, stop_within_s: float = 60.0, on_change: Callable[[], None] = lambda: None
    ) -> None:
        self._stop_within_s = stop_within_s
        self._on_change = on_change
        self.managed: list[ManagedProcess] = []
        self.failed: str | None = None
        self._stop = threading.Event()
        # Held while a process is started again, so that what is stopped is all there is.
        self._starting = threading.Lock()
        self._stopped = threading.Event()
        self._thread: threading.Thread | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def launch(self, managed: ManagedProcess) -> None:
        """Start a process and put it under supervision.

        Raises:
            StartupError: It did not start.
        """
        managed.process = managed.start()
        self.managed.append(managed)
        self._on_change()

    def watch(self) -> None:
        """Watch from a separate thread, which is also the parent of restarted processes."""
        self._thread = threading.Thread(target=self._watch, name="supervisor", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Stop watching, then stop the processes, the last started first."""
        self._stop.set()
        with self._starting:
            running = [
                (managed, managed.process)
                for managed in reversed(self.managed)
                if managed.process is not None
            ]
        threads = [
            threading.Thread(
                target=stop_process, args=(process, signal.SIGTERM, self._stop_within_s)
            )
            for managed, process in running
            if managed.stop is None
        ]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        for managed, process in running:
            if managed.stop is not None:
                managed.stop(process)
        self.managed.clear()
        self._stopped.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def _watch(self) -> None:
        while not self._stop.wait(LOOK_EVERY_S):
            for managed in self.managed:
                if managed.process is not None and managed.process.poll() is not None:
                    self._restart(managed, managed.process.returncode)
                    with contextlib.suppress(OSError):  # a full disk
                        self._on_change()
        # Children that it restarted are signalled when this thread ends: stay until they stop.
        self._stopped.wait()

    def _restart(self, managed: ManagedProcess, code: int) -> None:
        now = time.monotonic()
        managed.deaths.append(now)
        while managed.deaths and managed.deaths[0] < now - DEATHS_WITHIN_S:
            managed.deaths.popleft()
        log.warning("process_died", name=managed.name, code=code)
        if len(managed.deaths) > DEATHS_ALLOWED:
            managed.process = None
            self.failed = (
                f"{managed.name} died {len(managed.deaths)} times within "
                f"{DEATHS_WITHIN_S:.0f} s, last with exit code {code}"
            )
            return
        # The first restart is immediate; a process that keeps dying waits longer each time.
        if self._stop.wait(LOOK_EVERY_S * (2 ** (len(managed.deaths) - 1) - 1)):
            return
        with self._starting:
            if self._stop.is_set():
                return
            try:
                managed.process = managed.start()
            except (StartupError, OSError) as error:
                log.warning("restart_failed", name=managed.name, error=str(error))
