"""Rate limits, counted in the broker's key-value store so that all API processes share them."""

from __future__ import annotations

import math
import time
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
"""How long a request waits for its count."""
AGAIN_S = 1.0
"""How long a store that failed is left alone before one request asks it again."""
GROUP = "buildarena"

log = structlog.get_logger(__name__)


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
        self._failed, self._asked_again_at = False, 0.0
        self.spelled = rate.replace("/", " per ")

    async def hit(self, who: str) -> int | None:
        """Counts a request; None when it may pass, otherwise in how many seconds it may."""
        if not self._failed or time.monotonic() >= self._asked_again_at:
            # Of a store that failed one request asks; the others go on without it.
            self._asked_again_at = time.monotonic() + AGAIN_S
            try:
                passes = await self._shared.hit(self._item, GROUP, who)
                self._failed = False
                if passes:
                    return None
                return _wait_s(await self._shared.get_window_stats(self._item, GROUP, who))
            # What uvloop says of a connection that ended while nobody looked is a RuntimeError.
            except (RedisError, OSError, RuntimeError) as error:
                if not self._failed:
                    log.warning("rate_limits_unreachable", error=str(error))
                self._failed = True
        if self._own.hit(self._item, GROUP, who):
            return None
        return _wait_s(self._own.get_window_stats(self._item, GROUP, who))

    async def close(self) -> None:
        """Closes the connections."""
        await self._pool.aclose()


def _wait_s(stats: WindowStats) -> int:
    return max(1, math.ceil(stats.reset_time - time.time()))
