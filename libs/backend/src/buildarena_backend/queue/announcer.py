"""Messages sent in the background, so that nobody waits for the broker."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence

import structlog

LONGEST_JOIN_S = 5.0

log = structlog.get_logger(__name__)


class Announcer:
    """One thread, started by the first announcement.

    Args:
        send: Sends messages for ids to a queue.
        most: Ids that wait for each queue; more are left to the reaper, which sends them again.
    """

    def __init__(self, send: Callable[[str, Sequence[str]], object], *, most: int) -> None:
        self._send = send
        self._most = most
        # Mappings keep their order and each id once.
        self._waiting: dict[str, dict[str, None]] = {}
        self._changed = threading.Condition()
        self._thread: threading.Thread | None = None
        self._busy = False
        self._closed = False

    def announce(self, queue: str, ids: Sequence[str]) -> None:
        """Has messages sent soon; returns at once."""
        with self._changed:
            waiting = self._waiting.setdefault(queue, {})
            waiting.update(dict.fromkeys(ids[: max(0, self._most - len(waiting))]))
            if self._thread is None and not self._closed:
                self._thread = threading.Thread(target=self._run, name="announcer", daemon=True)
                self._thread.start()
            self._changed.notify_all()

    def wait(self, timeout_s: float = LONGEST_JOIN_S) -> bool:
        """Waits until nothing is to be sent; returns whether that came to be."""
        with self._changed:
            return self._changed.wait_for(lambda: not self._waiting and not self._busy, timeout_s)

    def close(self) -> None:
        """Ends the thread; what waits is left to the reaper."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
            thread = self._thread
        if thread is not None:
            thread.join(timeout=LONGEST_JOIN_S)

    def _run(self) -> None:
        while (announcement := self._next()) is not None:
            try:
                self._send(*announcement)
            except Exception:
                # What was not sent is sent again by the reaper; the thread must go on.
                log.exception("announcement_failed", queue=announcement[0])

    def _next(self) -> tuple[str, list[str]] | None:
        with self._changed:
            self._busy = False
            self._changed.notify_all()
            self._changed.wait_for(lambda: self._waiting or self._closed)
            if self._closed:
                return None
            self._busy = True
            queue = next(iter(self._waiting))
            return queue, list(self._waiting.pop(queue))
