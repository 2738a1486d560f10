"""How many requests may be open at a provider at once, over all workers.

The limit adapts: it halves when the provider says that it is too much, and grows by about one
for each limit's worth of answers (additive increase, multiplicative decrease; Chiu and Jain,
1989). Until the provider's limit was met once, it grows by one with each answer (slow start).
It lives in the broker's key-value store; without it, each process goes on by itself.

A slot that came free stays with its process for a moment, so that a session's next request finds
it there, unless another request was refused lately. A process renews the slots it has; those of a
process that died are free again soon.
"""

from __future__ import annotations

import asyncio
import random
import uuid
from collections import deque
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from typing import Any

from buildarena_worker.providers.batched_redis import BatchedRedis

START, MIN_LIMIT, MAX_LIMIT = 64.0, 1.0, 2048.0
SLOT_TTL_S = 30
"""A slot that was not renewed for so long is free again: its process died."""
CALM_S = 2
"""Several complaints within this time count as one: they speak of the same crowd."""
SPARE_S = 0.25
"""How long a free slot stays with its process: longer than a session takes for its next request."""
RETRY_S = 0.02, 0.1
"""A refused request tries again after a random time between these."""
REFUSED_MS = 150
"""While one waits, which shows for this time, a new request waits its turn like it."""
LIMIT_KEPT_S = 86400

_PARTS = ("open", "limit", "calm", "met", "refused")
_TAKE = f"""
local now = tonumber(redis.call('TIME')[1])
redis.call('ZREMRANGEBYSCORE', KEYS[1], '-inf', now)
local limit = tonumber(redis.call('GET', KEYS[2]) or ARGV[3])
if redis.call('ZCARD', KEYS[1]) >= math.floor(limit) then
  redis.call('SET', KEYS[5], 1, 'PX', {REFUSED_MS})
  return 0
end
if ARGV[4] == 'new' and redis.call('EXISTS', KEYS[5]) == 1 then return 0 end
redis.call('ZADD', KEYS[1], now + ARGV[2], ARGV[1])
return 1
"""
_GIVE = f"""
local limit = tonumber(redis.call('GET', KEYS[2]) or ARGV[3])
if ARGV[2] == 'grow' then
  local step = redis.call('EXISTS', KEYS[4]) == 1 and 1 / limit or 1
  limit = math.min({MAX_LIMIT}, limit + step)
elseif ARGV[2] == 'shrink' and redis.call('SET', KEYS[3], 1, 'NX', 'EX', {CALM_S}) then
  limit = math.max({MIN_LIMIT}, limit / 2)
  redis.call('SET', KEYS[4], 1, 'EX', {LIMIT_KEPT_S})
end
redis.call('SET', KEYS[2], tostring(limit), 'EX', {LIMIT_KEPT_S})
if redis.call('EXISTS', KEYS[5]) == 0 and redis.call('ZCARD', KEYS[1]) <= math.floor(limit) then
  return 1
end
redis.call('ZREM', KEYS[1], ARGV[1])
return 0
"""
_RENEW = """
local now = tonumber(redis.call('TIME')[1])
for place = 2, #ARGV do redis.call('ZADD', KEYS[1], 'XX', now + ARGV[1], ARGV[place]) end
"""


class Throttle:
    """The shared limit of one provider.

    Args:
        url: ``redis://…`` of the key-value store, or None to never wait.
        provider: The provider's name.
        start: The limit to begin with.
    """

    def __init__(self, url: str | None, provider: str, *, start: float = START) -> None:
        self._store = None if url is None else BatchedRedis(url)
        self._keys = [f"buildarena:throttle:{provider}:{part}" for part in _PARTS]
        self._start = start
        self._taken: set[str] = set()
        self._spare: deque[tuple[str, float]] = deque()
        self._renewing: asyncio.Task[None] | None = None
        self._closed = False

    @asynccontextmanager
    async def slot(self) -> AsyncIterator[Slot]:
        """Waits for a free slot and keeps it inside the block; say there how it went."""
        slot = Slot()
        taken = None if self._store is None else await self._take(self._store)
        try:
            yield slot
        finally:
            if taken is not None and self._store is not None:
                self._give(self._store, taken, slot.verdict)

    async def limit(self) -> float:
        """The limit now."""
        raw = None if self._store is None else await self._store.execute("GET", self._keys[1])
        return self._start if raw is None else float(raw)

    async def close(self) -> None:
        """Gives all slots back and closes the connection."""
        if self._store is None:
            return
        self._closed = True
        if self._renewing is not None:
            self._renewing.cancel()
            with suppress(asyncio.CancelledError):
                await self._renewing
        if self._taken:
            self._store.execute_nowait("ZREM", self._keys[0], *self._taken)
        await self._store.close()

    async def _take(self, store: BatchedRedis) -> str | None:
        """The id of a slot; None when the store fails, without which requests go on."""
        slot_id, standing = uuid.uuid4().hex, "new"
        while not self._spare:
            try:
                if await self._eval(store, _TAKE, slot_id, SLOT_TTL_S, self._start, standing):
                    self._add(store, slot_id)
                    return slot_id
            except asyncio.CancelledError:  # it may have been taken all the same
                store.execute_nowait("ZREM", self._keys[0], slot_id)
                raise
            except Exception:  # noqa: BLE001 - the store has logged it
                return None
            standing = "waiting"
            await asyncio.sleep(random.uniform(*RETRY_S))  # noqa: S311 - spreads waits
        return self._spare.pop()[0]

    def _give(self, store: BatchedRedis, slot_id: str, verdict: str) -> None:
        """Frees a slot soon; the request that had it does not wait for that."""

        def received(answer: asyncio.Future[Any]) -> None:
            if answer.cancelled() or answer.exception() is not None or not answer.result():
                self._taken.discard(slot_id)
                return
            loop = asyncio.get_running_loop()
            self._spare.append((slot_id, loop.time()))
            loop.call_later(SPARE_S, self._return_spares, store)

        answer = self._eval(store, _GIVE, slot_id, verdict, self._start)
        answer.add_done_callback(received)

    def _return_spares(self, store: BatchedRedis) -> None:
        """Gives back the slots that nobody has wanted for a while."""
        if self._closed:
            return
        oldest = asyncio.get_running_loop().time() - SPARE_S
        while self._spare and self._spare[0][1] <= oldest:
            slot_id, _ = self._spare.popleft()
            self._taken.discard(slot_id)
            store.execute_nowait("ZREM", self._keys[0], slot_id)

    def _add(self, store: BatchedRedis, slot_id: str) -> None:
        self._taken.add(slot_id)
        if self._renewing is None or self._renewing.done():
            self._renewing = asyncio.create_task(self._renew(store))

    async def _renew(self, store: BatchedRedis) -> None:
        while self._taken:
            await asyncio.sleep(SLOT_TTL_S / 3)
            with suppress(Exception):  # the store has logged it; the next time may do
                await self._eval(store, _RENEW, SLOT_TTL_S, *self._taken)

    def _eval(self, store: BatchedRedis, script: str, *arguments: Any) -> asyncio.Future[Any]:
        return store.execute("EVAL", script, len(self._keys), *self._keys, *arguments)


class Slot:
    """One open request."""

    def __init__(self) -> None:
        self.verdict = "keep"

    def succeeded(self) -> None:
        """The provider answered: it may take a little more."""
        self.verdict = "grow"

    def rejected(self) -> None:
        """The provider complained of the load: halve it."""
        self.verdict = "shrink"
