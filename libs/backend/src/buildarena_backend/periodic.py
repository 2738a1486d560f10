"""Work that a thread repeats."""

from __future__ import annotations

import threading
from collections.abc import Callable

import structlog

from buildarena_backend.errors import StoreError

LONGEST_JOIN_S = 10.0

log = structlog.get_logger(__name__)


class Periodic:
    """Calls something every so often, from its start until it is stopped.

    Args:
        work: Its errors are logged, and it is called again: the thread outlives them.
        name: Of the thread, and of the work in the log.
        period_s: Seconds before each call.

    Attributes:
        expected: Errors that are logged in a line; a runner's process does not load a database's.
    """

    expected: type[Exception] = StoreError

    def __init__(self, work: Callable[[], None], *, name: str, period_s: float) -> None:
        self._work, self._name = work, name
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
            try:
                self._work()
            except self.expected as error:
                why = str(error).splitlines()[0]
                log.warning("periodic_work_failed", work=self._name, error=why)
            except Exception:
                log.exception("periodic_work_failed", work=self._name)
