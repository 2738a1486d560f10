"""Processes that do one piece of work after another; one that crashes costs that work only."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from queue import SimpleQueue
from typing import Any, Self

from buildarena_environment.warm_process import ProcessEndedError, WarmProcess

AHEAD = 4
"""Pieces of work that wait for each process."""


class Crew:
    """Processes for a kind of work. Use it as a context.

    Args:
        make: Called first in each process, gives what does the work; picklable by name.
        processes: How many; by default one for each core that this process may use.
    """

    def __init__(
        self, make: Callable[[], Callable[[Any], Any]], processes: int | None = None
    ) -> None:
        count = processes or len(os.sched_getaffinity(0))
        self._processes = [WarmProcess(f"machines {n + 1}", make) for n in range(count)]
        self._free: SimpleQueue[WarmProcess] = SimpleQueue()
        for process in self._processes:
            self._free.put(process)
        self._threads = ThreadPoolExecutor(count, thread_name_prefix="machines")
        self.ahead = AHEAD * count

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._threads.shutdown(wait=False, cancel_futures=True)
        for process in self._processes:
            process.close()
        self._threads.shutdown()
        for process in self._processes:
            process.close()

    def submit(self, work: Any) -> Future[Any]:
        """Has work done when its turn comes; None comes of what crashes its process."""
        return self._threads.submit(self._done, work)

    def _done(self, work: Any) -> Any:
        process = self._free.get()
        try:
            return process.ask(work)
        except ProcessEndedError:
            return None
        finally:
            self._free.put(process)
