"""The event loop on which a process' model requests run."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Coroutine
from contextlib import nullcontext
from typing import Any, TypeVar

from buildarena_pipeline.runtime.active_lease import ActiveLease

Result = TypeVar("Result")


class RequestLoop:
    """An event loop in a thread of its own, started by the first of many threads that need it."""

    def __init__(self) -> None:
        self._loop: asyncio.AbstractEventLoop | None = None
        # Sessions start all at once. Without it several of them make a loop each, and clients
        # fail because their locks belong to another loop.
        self._starting = threading.Lock()

    def run(self, work: Coroutine[Any, Any, Result], active: ActiveLease | None = None) -> Result:
        """The result of work on the loop; the calling thread waits for it.

        Args:
            work: What is to be done.
            active: The lease that it is done under.

        Raises:
            CancelledError: The lease was lost; the work ends at once, wherever it waits.
        """
        future = asyncio.run_coroutine_threadsafe(work, self._started())
        with nullcontext() if active is None else active.calling(future.cancel):
            return future.result()

    def _started(self) -> asyncio.AbstractEventLoop:
        with self._starting:
            if self._loop is None:
                self._loop = asyncio.new_event_loop()
                threading.Thread(
                    target=self._loop.run_forever, name="model-requests", daemon=True
                ).start()
            return self._loop
