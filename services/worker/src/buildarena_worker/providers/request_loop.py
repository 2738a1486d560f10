"""The event loop on which a process' model requests run."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Coroutine
from typing import Any, TypeVar

from buildarena_worker.session.messages import UNBOUNDED, RequestOptions

Result = TypeVar("Result")


class RequestLoop:
    """An event loop in a thread of its own, started by the first of many threads that need it."""

    def __init__(self) -> None:
        self._loop: asyncio.AbstractEventLoop | None = None
        # Sessions start all at once. Without it several of them make a loop each, and clients
        # fail because their locks belong to another loop.
        self._starting = threading.Lock()

    def run(self, work: Coroutine[Any, Any, Result], options: RequestOptions = UNBOUNDED) -> Result:
        """The result of work on the loop; the calling thread waits for it.

        Args:
            work: What is to be done.
            options: The lease that it is done under, and whether it may cost something by now.

        Raises:
            CancelledError: The lease was lost, and the work ended at once, wherever it waited; or
                its worker stops, and nothing had been sent yet.
        """
        loop, active = self._started(), options.active
        if active is None:
            return asyncio.run_coroutine_threadsafe(work, loop).result()
        begun: asyncio.Future[asyncio.Task[Result]] = asyncio.Future(loop=loop)

        async def run() -> Result:
            task = asyncio.ensure_future(work)
            begun.set_result(task)
            return await task

        async def give_up() -> None:
            # Here nothing is sent between the question and the end.
            task = await begun
            if active.lost or not options.sent.is_set():
                task.cancel()

        future = asyncio.run_coroutine_threadsafe(run(), loop)
        with active.calling(lambda: asyncio.run_coroutine_threadsafe(give_up(), loop)):
            return future.result()

    def _started(self) -> asyncio.AbstractEventLoop:
        with self._starting:
            if self._loop is None:
                self._loop = asyncio.new_event_loop()
                threading.Thread(
                    target=self._loop.run_forever, name="model-requests", daemon=True
                ).start()
            return self._loop
