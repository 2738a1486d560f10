"""Rate limits, counted in the broker's key-value store so that all API processes share them."""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Awaitable, Callable
from contextlib import suppress
from typing import Any

import structlog
from limits import WindowStats, parse
from limits.aio.storage import RedisStorage
from limits.aio.strategies import SlidingWindowCounterRateLimiter as SharedLimiter
from limits.storage import MemoryStorage
from limits.strategies import SlidingWindowCounterRateLimiter as OwnLimiter
from redis.asyncio import ConnectionPool
from redis.asyncio.retry import Retry
from redis.backoff import NoBackoff
from redis.exceptions import RedisError

TIMEOUT_S = 0.3
"""How long a request waits for its count; the store is not asked again until it answers."""
PROBE_S = 1.0
GROUP = "buildarena"

log = structlog.get_logger(__name__)


class CircuitBreaker:
    """Says to the coroutines of one event loop whether a server may be asked.

    One that failed is not asked again until a probe finds it well.

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


class RateLimits:
    """Counts requests per caller.

    Args:
        broker_url: Where counts are kept; while it does not answer, this process counts alone.
        rate: For example ``600/minute``.
    """

    def __init__(self, broker_url: str, rate: str) -> None:
        self._item = parse(rate)
        self._pool = ConnectionPool.from_url(
            broker_url,
            socket_timeout=TIMEOUT_S,
            socket_connect_timeout=TIMEOUT_S,
            retry=Retry(NoBackoff(), 0),
        )
        # Its signature names fewer types than it hands on to redis.
        handed_on: dict[str, Any] = {"connection_pool": self._pool}
        self._storage = RedisStorage(f"async+{broker_url}", implementation="redispy", **handed_on)
        self._shared = SharedLimiter(self._storage)
        self._own = OwnLimiter(MemoryStorage())
        self._breaker = CircuitBreaker(self._storage.check)
        self.spelled = rate.replace("/", " per ")

    async def hit(self, who: str) -> int | None:
        """Counts a request; None when it may pass, otherwise in how many seconds it may."""
        if not self._breaker.is_open:
            try:
                if await self._shared.hit(self._item, GROUP, who):
                    return None
                return _wait_s(await self._shared.get_window_stats(self._item, GROUP, who))
            # What uvloop says of a connection that ended while nobody looked is a RuntimeError.
            except (RedisError, OSError, RuntimeError) as error:
                if not self._breaker.is_open:
                    log.warning("rate_limits_unreachable", error=str(error))
                self._breaker.failed()
        if self._own.hit(self._item, GROUP, who):
            return None
        return _wait_s(self._own.get_window_stats(self._item, GROUP, who))

    async def close(self) -> None:
        """Closes the connections."""
        await self._breaker.close()
        await self._pool.aclose()


def _wait_s(stats: WindowStats) -> int:
    return max(1, math.ceil(stats.reset_time - time.time()))
