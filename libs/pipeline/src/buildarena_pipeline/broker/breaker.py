"""A circuit breaker: a server that failed is not asked again until one probe finds it well."""

from __future__ import annotations

import threading
from collections.abc import Callable

PROBE_S = 1.0


class CircuitBreaker:
    """Says whether a server may be asked.

    Args:
        probe: Asks the server something small; returns whether it answers. It is called from a
            thread that lives only while the breaker is open.
        period_s: Seconds before each probe.
    """

    def __init__(self, probe: Callable[[], bool], *, period_s: float = PROBE_S) -> None:
        self._probe = probe
        self._period_s = period_s
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    @property
    def is_open(self) -> bool:
        """Whether the server failed and has not answered since."""
        return self._thread is not None

    def failed(self) -> None:
        """Notes a failure: nobody asks from now on."""
        with self._lock:
            if self._thread is None and not self._stop.is_set():
                self._thread = threading.Thread(target=self._watch, name="probe", daemon=True)
                self._thread.start()

    def close(self) -> None:
        """Ends the probes."""
        self._stop.set()
        thread = self._thread
        if thread is not None and thread is not threading.current_thread():
            thread.join(timeout=2 * self._period_s)

    def _watch(self) -> None:
        while not self._stop.wait(self._period_s):
            if self._probe():
                break
        self._thread = None
