"""Work that a thread repeats."""

from __future__ import annotations

import threading
from collections.abc import Callable

LONGEST_JOIN_S = 10.0


class Periodic:
    """Calls something every so often, from its start until it is stopped.

    Args:
        work: Handles its own errors: an exception ends the thread.
        period_s: Seconds before each call.
    """

    def __init__(self, work: Callable[[], None], *, name: str, period_s: float) -> None:
        self._work = work
        self._period_s = period_s
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self) -> None:
        """Stop the thread, if it was started, and wait for it."""
        self._stop.set()
        if self._thread.ident is not None:
            self._thread.join(timeout=LONGEST_JOIN_S)

    def _run(self) -> None:
        while not self._stop.wait(self._period_s):
            self._work()
