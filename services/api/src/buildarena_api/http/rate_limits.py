"""Rate limits, counted in the broker's key-value store so that all API processes share them."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import structlog
from limits import WindowStats, parse
from limits.aio.storage import RedisStorage
from limits.aio.strategies import SlidingWindowCounterRateLimiter as SharedLimiter
from limits.storage import MemoryStorage
from limits.strategies import SlidingWindowCounterRateLimiter as OwnLimiter
from redis.asyncio import ConnectionPool, Redis
from redis.asyncio.retry import Retry
from redis.backoff import NoBackoff
from redis.exceptions import RedisError

TIMEOUT_S = 0.3
"""Wait of a request for its count."""
AGAIN_S = 1.0
"""Pause after a failure of the store before one request tries it again."""
REMEMBERED_S: Final = 24 * 3600
GROUP = "buildarena"

log = structlog.get_logger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class Count:
    """State of a caller's rate limit.

    Attributes:
        passes: Whether the request may pass.
        reset_s: Seconds until the window ends, at least 1.
        headers: What an answer says of it.
    """

    passes: bool
    reset_s: int
    headers: Mapping[str, str]


class RateLimits:
    """Counts requests per caller.

    Args:
        broker_url: Store of the counts; while it does not answer, this process counts alone.
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

    async def hit(self, caller: str) -> Count:
        """Count a request."""
        if not self._failed or time.monotonic() >= self._asked_again_at:
            # One request tries a store that failed; the others continue without it.
            self._asked_again_at = time.monotonic() + AGAIN_S
            try:
                passes = await self._shared.hit(self._item, GROUP, caller)
                stats = await self._shared.get_window_stats(self._item, GROUP, caller)
                self._failed = False
                return self._count(passes, stats)
            # uvloop raises RuntimeError for a connection that ended unnoticed.
            except (RedisError, OSError, RuntimeError) as error:
                if not self._failed:
                    log.warning("rate_limits_unreachable", error=str(error))
                self._failed = True
        passes = self._own.hit(self._item, GROUP, caller)
        return self._count(passes, self._own.get_window_stats(self._item, GROUP, caller))

    async def store_first(self, name: str, value: str) -> str:
        """Return the first value stored under a name within a day; this one if there is none."""
        try:
            store = Redis(connection_pool=self._pool)
            before: Any = await store.set(
                f"{GROUP}:{name}", value, nx=True, get=True, ex=REMEMBERED_S
            )
        except (RedisError, OSError, RuntimeError) as error:
            log.warning("rate_limits_unreachable", error=str(error))
            return value
        return value if before is None else str(before.decode())

    async def close(self) -> None:
        """Close the connections."""
        await self._pool.aclose()

    def _count(self, passes: bool, stats: WindowStats) -> Count:
        reset_s = max(1, math.ceil(stats.reset_time - time.time()))
        headers = {
            "RateLimit-Limit": str(self._item.amount),
            "RateLimit-Remaining": str(max(0, stats.remaining)),
            "RateLimit-Reset": str(reset_s),
        }
        return Count(passes=passes, reset_s=reset_s, headers=headers)
