"""The turnstile: few of a process' sessions work at once, the others wait outside."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

PLACES = 4
"""More than one, because a session inside also waits for the database. With 2 a process of 200
sessions does less, with 6 no more."""
PATIENCE_S = 1.0
"""Whoever waited so long goes in all the same: nothing that happens inside can stop the others."""


class ConcurrencyGate:
    """Keeps a crowd of sessions from all working at the same time.

    Model replies come in bursts. If all sessions that got one work at once, each is done only when
    nearly all are, they ask their models at the same moment, and the next burst is no smaller.
    One after the other, each asks as soon as it is done, the replies come spread, and nobody
    waits. No session waits for long: this is about order, it guards nothing.

    Args:
        places: Sessions inside at once.
        patience_s: Longest wait for a place.
    """

    def __init__(self, places: int = PLACES, patience_s: float = PATIENCE_S) -> None:
        self._places = threading.Semaphore(places)
        self._patience_s = patience_s
        self._mine = threading.local()

    @contextmanager
    def acquired(self) -> Iterator[None]:
        """Waits for a place and has it inside the block."""
        self._enter()
        try:
            yield
        finally:
            self._leave()

    @contextmanager
    def released(self) -> Iterator[None]:
        """Gives the thread's place away inside the block, in which it waits for something."""
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
