"""The event loop on which a process' model requests run."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Coroutine
from typing import Any, TypeVar

Result = TypeVar("Result")


class RequestLoop:
    """An event loop in a thread of its own, started by the first of many threads that need it."""

    def __init__(self) -> None:
        self._loop: asyncio.AbstractEventLoop | None = None
        # Sessions start all at once. Without it several of them make a loop each, and clients
        # fail because their locks belong to another loop.
        self._starting = threading.Lock()

    def run(self, work: Coroutine[Any, Any, Result]) -> Result:
        """The result of work on the loop; the calling thread waits for it."""
        return asyncio.run_coroutine_threadsafe(work, self._started()).result()

    def _started(self) -> asyncio.AbstractEventLoop:
        with self._starting:
            if self._loop is None:
                self._loop = asyncio.new_event_loop()
                threading.Thread(
                    target=self._loop.run_forever, name="model-requests", daemon=True
                ).start()
            return self._loop
