"""The concurrency gate: few of a process' sessions work at once, the others wait."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

PLACES = 4
"""More than one, because a session that works also waits for the database. With 2 a process of 200
sessions does less, with 6 no more."""
PATIENCE_S = 1.0
"""After so long a session starts without a place, so that a stuck one can't stop the others."""


class ConcurrencyGate:
    """Keeps a crowd of sessions from all working at the same time.

    Model replies come in bursts. If all sessions that got one work at once, each is done only when
    nearly all are, they ask their models at the same moment, and the next burst is as large. If
    they work one after the other, each asks as soon as it is done, the replies come at different
    times, and no session waits. The gate only puts sessions in order; nothing depends on it for
    correctness.

    Args:
        places: Sessions that work at once.
        patience_s: Longest wait for a place.
    """

    def __init__(self, places: int = PLACES, patience_s: float = PATIENCE_S) -> None:
        self._places = threading.Semaphore(places)
        self._patience_s = patience_s
        self._mine = threading.local()

    @contextmanager
    def acquired(self) -> Iterator[None]:
        """Wait for a place and keep it inside the block."""
        self._enter()
        try:
            yield
        finally:
            self._leave()

    @contextmanager
    def released(self) -> Iterator[None]:
        """Give up the thread's place inside the block, in which it waits for something."""
        self._leave()
        try:
            yield
        finally:
            self._enter()

    def _enter(self) -> None:
        self._mine.place = self._places.acquire(timeout=self._patience_s)

    def _leave(self) -> None:
        if self._mine.place:
            self._places.release()
            self._mine.place = False
