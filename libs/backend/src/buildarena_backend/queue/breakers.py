"""Circuit breakers: a server that failed is not asked again until one probe finds it well."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from contextlib import suppress

import structlog

PROBE_S = 1.0

log = structlog.get_logger(__name__)


class AsyncCircuitBreaker:
    """Says to the coroutines of one event loop whether a server may be asked.

    Args:
        probe: Asks the server something small; returns whether it answers. It is awaited in a task
            that lives only while the breaker is open.
        period_s: Seconds before each probe.
    """

    def __init__(self, probe: Callable[[], Awaitable[bool]], *, period_s: float = PROBE_S) -> None:
        self._probe = probe
        self._period_s = period_s
        self._closed = False
        self._task: asyncio.Task[None] | None = None

    @property
    def is_open(self) -> bool:
        """Whether the server failed and has not answered since."""
        return self._task is not None

    def failed(self) -> None:
        """Notes a failure: nobody asks from now on."""
        if self._task is None and not self._closed:
            self._task = asyncio.create_task(self._watch())

    async def close(self) -> None:
        """Ends the probes."""
        self._closed = True
        task = self._task
        if task is not None:
            task.cancel()
            with suppress(asyncio.CancelledError):
                await task

    async def _watch(self) -> None:
        # A probe may swallow its cancellation, as that of the library of rate limits does.
        while not self._closed:
            await asyncio.sleep(self._period_s)
            try:
                if await self._probe():
                    break
            except Exception:
                log.exception("probe_failed")
        self._task = None
