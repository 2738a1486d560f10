"""Adaptive limit on the open requests at a provider, over all workers.

It halves when the provider reports too many requests, and grows by about one
for each limit's worth of answers (additive increase, multiplicative decrease; Chiu and Jain,
1989). Until the provider's limit was met once, it grows by one with each answer (slow start).
It is stored in the broker's key-value store; without the store, requests are not limited.

An owner (an API key) without an open request at the provider may always send one, so that requests
of one owner that hang do not block others. Requests of one owner in one process wait in line, and
only the first asks the store; while it waits, requests that come later wait too, everywhere.

A process renews its slots; those of a process that died expire.
"""

from __future__ import annotations

import asyncio
import random
import time
import uuid
from collections import defaultdict
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Any

import structlog
from redis.asyncio import Redis
from redis.asyncio.retry import Retry
from redis.backoff import NoBackoff
from redis.exceptions import RedisError

log = structlog.get_logger(__name__)

START, MIN_LIMIT, MAX_LIMIT = 64.0, 1.0, 2048.0
SLOT_TTL_S = 30
"""A slot that was not renewed for this time expires: its process died."""
CALM_S = 2
"""Rejections within this time count as one: they have the same cause."""
RETRY_S = 0.02, 0.1
"""Limits of the random wait before a refused request tries again."""
REFUSED_MS = 150
"""Time that a refused request makes new requests wait as well."""
LIMIT_STORED_S = 86400
TIMEOUT_S = 3.0
"""Longest wait for the store: longer than a busy process or machine keeps an answer waiting."""
CONNECTIONS = 8
"""Concurrent scripts; with one, 200 sessions with a request a second each block each other."""
AWAY_S = 10.0
"""Time that a store is not used after it failed."""

_PARTS = ("open", "limit", "calm", "met", "refused")
_TAKE = f"""
local now = tonumber(redis.call('TIME')[1])
redis.call('ZREMRANGEBYSCORE', KEYS[1], '-inf', now)
redis.call('ZREMRANGEBYSCORE', KEYS[6], '-inf', now)
local limit = math.min(tonumber(redis.call('GET', KEYS[2]) or ARGV[3]), tonumber(ARGV[5]))
if redis.call('ZCARD', KEYS[1]) >= math.floor(limit) then
  if redis.call('ZCARD', KEYS[6]) > 0 then
    redis.call('SET', KEYS[5], 1, 'PX', {REFUSED_MS})
    return 0
  end
elseif ARGV[4] == 'new' and redis.call('EXISTS', KEYS[5]) == 1 then
  return 0
end
for _, open in ipairs({{KEYS[1], KEYS[6]}}) do redis.call('ZADD', open, now + ARGV[2], ARGV[1]) end
redis.call('EXPIRE', KEYS[6], ARGV[2])
return 1
"""
_GIVE = f"""
for _, open in ipairs({{KEYS[1], KEYS[6]}}) do redis.call('ZREM', open, ARGV[1]) end
local limit = tonumber(redis.call('GET', KEYS[2]) or ARGV[2])
if ARGV[3] == 'grow' then
  local step = redis.call('EXISTS', KEYS[4]) == 1 and 1 / limit or 1
  limit = math.min(tonumber(ARGV[4]), limit + step)
elseif ARGV[3] == 'shrink' and redis.call('SET', KEYS[3], 1, 'NX', 'EX', {CALM_S}) then
  limit = math.max({MIN_LIMIT}, limit / 2)
  redis.call('SET', KEYS[4], 1, 'EX', {LIMIT_STORED_S})
end
redis.call('SET', KEYS[2], tostring(limit), 'EX', {LIMIT_STORED_S})
"""
_RENEW = """
local now = tonumber(redis.call('TIME')[1])
for _, open in ipairs({KEYS[1], KEYS[6]}) do
  redis.call('ZADD', open, 'XX', now + ARGV[2], ARGV[1])
end
redis.call('EXPIRE', KEYS[6], ARGV[2])
"""


class Throttle:
    """The shared limit of one provider.

    Args:
        url: ``redis://…`` of the key-value store, or None to never wait.
        provider: The provider's name.
        start: Initial limit.
        maximum: Upper bound of the limit; by default MAX_LIMIT.
    """

    def __init__(
        self,
        url: str | None,
        provider: str,
        *,
        start: float = START,
        maximum: float | None = None,
    ) -> None:
        self._maximum = maximum or MAX_LIMIT
        self._store: Any = None
        if url is not None:
            waits: dict[str, Any] = {
                "socket_timeout": TIMEOUT_S,
                "socket_connect_timeout": TIMEOUT_S,
            }
            self._store = Redis.from_url(url, **waits, retry=Retry(NoBackoff(), 0))
        self._prefix = f"buildarena:throttle:{provider}:"
        self._start = start
        self._asking = asyncio.Semaphore(CONNECTIONS)
        self._lines: defaultdict[str, asyncio.Lock] = defaultdict(asyncio.Lock)
        self._away_until = 0.0
        self._open: dict[str, str] = {}  # owners by slot
        self._renewing: asyncio.Task[None] | None = None

    @asynccontextmanager
    async def slot(self, owner: str = "") -> AsyncIterator[Slot]:
        """Wait for a free slot, and hold it inside the block, which reports the result to it."""
        slot, id_ = Slot(), uuid.uuid4().hex
        try:
            async with self._lines[owner]:
                await self._take(id_, owner)
            yield slot
        finally:  # a request that was cancelled while it waited may have a slot
            self._open.pop(id_, None)
            await self._ask(_GIVE, owner, id_, self._start, slot.verdict, self._maximum)

    async def close(self) -> None:
        """Release all slots and close the connection."""
        if self._renewing is not None:
            self._renewing.cancel()
            await asyncio.gather(self._renewing, return_exceptions=True)
        for id_, owner in list(self._open.items()):
            await self._ask(_GIVE, owner, id_, self._start, "keep", self._maximum)
        if self._store is not None:
            await self._store.aclose()

    async def _take(self, id_: str, owner: str) -> None:
        """Wait until the store grants a slot; requests are not limited while it fails."""
        state = "new"
        arguments = owner, id_, SLOT_TTL_S, self._start
        while await self._ask(_TAKE, *arguments, state, self._maximum) == 0:
            state = "waiting"
            await asyncio.sleep(random.uniform(*RETRY_S))  # noqa: S311 - spreads waits
        self._open[id_] = owner
        if self._renewing is None or self._renewing.done():
            self._renewing = asyncio.create_task(self._renew())

    async def _renew(self) -> None:
        while self._open:
            await asyncio.sleep(SLOT_TTL_S / 3)
            for id_, owner in list(self._open.items()):
                await self._ask(_RENEW, owner, id_, SLOT_TTL_S)

    async def _ask(self, script: str, owner: str, *arguments: Any) -> Any:
        """Return the result of a script; None without a working store."""
        keys = [self._prefix + part for part in (*_PARTS, f"open:{owner}")]
        async with self._asking:
            if self._store is None or time.monotonic() < self._away_until:
                return None
            try:
                return await self._store.eval(script, len(keys), *keys, *arguments)
            except (RedisError, OSError) as error:
                self._away_until = time.monotonic() + AWAY_S
                log.warning("store_failed", error=str(error))
                return None


@dataclass
class Slot:
    """An open request.

    Attributes:
        verdict: Effect of its result on the limit: "keep", "grow" or "shrink".
    """

    verdict: str = "keep"
