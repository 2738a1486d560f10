"""Rate limits, counted in the broker's key-value store so that all API processes share them."""

from __future__ import annotations

import math
import time

import structlog
from limits import parse
from limits.storage import storage_from_string
from limits.strategies import SlidingWindowCounterRateLimiter
from redis.exceptions import RedisError

log = structlog.get_logger(__name__)


class RateLimits:
    """Counts requests per caller.

    Args:
        broker_url: Where counts are kept.
        rate: For example ``600/minute``.
    """

    def __init__(self, broker_url: str, rate: str) -> None:
        self._item = parse(rate)
        self._limiter = SlidingWindowCounterRateLimiter(
            storage_from_string(broker_url, socket_timeout=1, socket_connect_timeout=1)
        )
        self.spelled = rate.replace("/", " per ")

    def hit(self, who: str) -> int | None:
        """Counts a request.

        Args:
            who: The caller.

        Returns:
            None when it may pass, otherwise after how many seconds the next one may. Without the
            key-value store all requests pass.
        """
        try:
            if self._limiter.hit(self._item, "buildarena", who):
                return None
            reset = self._limiter.get_window_stats(self._item, "buildarena", who).reset_time
        except (RedisError, OSError) as error:
            log.warning("rate_limits_unreachable", error=str(error))
            return None
        return max(1, math.ceil(reset - time.time()))
