"""Side work: what a worker does besides jobs, in few of its threads."""

from __future__ import annotations

import threading
from collections.abc import Callable

MAX_THREADS = 2
"""Side work is computation: more threads of one process would get no more of it done."""


class SideWork:
    """Does what messages of a queue name, a few at once; the rest waits its turn.

    However many there are, all other threads of the pool are left to the jobs.

    Args:
        work: Does one piece of work, by its id.
        threads: How many at once.
    """

    def __init__(self, work: Callable[[str], None], threads: int = MAX_THREADS) -> None:
        self._work = work
        self._free = threads
        self._waiting: dict[str, None] = {}
        self._lock = threading.Lock()
        self._stopping = False

    def do(self, work_id: str) -> None:
        """Does a piece of work and those that came meanwhile, or leaves it to those at work."""
        with self._lock:
            self._waiting[work_id] = None
            if not self._free:
                return
            self._free -= 1
        while (next_id := self._next()) is not None:
            try:
                self._work(next_id)
            except BaseException:
                with self._lock:
                    self._free += 1
                raise

    def stop(self) -> None:
        """Begins nothing more."""
        self._stopping = True

    def _next(self) -> str | None:
        """What is to be done next; else the thread's place is free again, in the same moment."""
        with self._lock:
            if self._stopping or not self._waiting:
                self._free += 1
                return None
            work_id = next(iter(self._waiting))
            del self._waiting[work_id]
            return work_id
