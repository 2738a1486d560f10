"""The concurrency gate, which limits how many of a process' sessions compute at once."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

PLACES = 4
"""More than one, because sessions also wait for the database. With 200 sessions,
throughput is lower with 2 and no higher with 6."""
PATIENCE_S = 1.0
"""Time after which a session starts without a place, so that a stuck one can't block the others."""


class ConcurrencyGate:
    """Limit on the sessions that compute at the same time.

    Model replies arrive in bursts. If all sessions of a burst compute at once, all finish and send
    their next requests at about the same time, and the next burst is as large. If they compute one
    after the other, requests and replies spread out, and no session waits. The gate only orders
    sessions; correctness does not depend on it.

    Args:
        places: Number of sessions that may compute at once.
        patience_s: Longest wait for a place.
    """

    def __init__(self, places: int = PLACES, patience_s: float = PATIENCE_S) -> None:
        self._places = threading.BoundedSemaphore(places)
        self._patience_s = patience_s

    @contextmanager
    def acquired(self) -> Iterator[None]:
        """Wait for a place, and hold it inside the block."""
        self._places.acquire(timeout=self._patience_s)
        try:
            yield
        finally:
            self._leave()

    @contextmanager
    def released(self) -> Iterator[None]:
        """Release the place inside a block of `acquired`, for example to wait for a reply."""
        self._leave()
        try:
            yield
        finally:
            self._places.acquire(timeout=self._patience_s)

    def _leave(self) -> None:
        # A session that began without a place returns a stuck one's, whose own is then too many.
        with suppress(ValueError):
            self._places.release()
