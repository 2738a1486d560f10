"""How many requests may be open at a provider at once, over all workers.

The limit adapts: it halves when the provider says that it is too much, and grows by about one
for each limit's worth of answers (additive increase, multiplicative decrease; Chiu and Jain,
1989). Until the provider's limit was met once, it grows by one with each answer (slow start).
It lives in the broker's key-value store; without it, each process goes on by itself.

An owner (an API key) that has no request open at the provider may always send one: whoever's
requests hang there, others are not held.

A slot that came free stays with its process for a moment, so that a session's next request finds
it there, unless another request was refused lately. A process renews the slots it has; those of a
process that died are free again soon.
"""

from __future__ import annotations

import asyncio
import random
import uuid
from collections import defaultdict, deque
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
LIMIT_STORED_S = 86400

_PARTS = ("open", "limit", "calm", "met", "refused")
_TAKE = f"""
local now = tonumber(redis.call('TIME')[1])
redis.call('ZREMRANGEBYSCORE', KEYS[1], '-inf', now)
redis.call('ZREMRANGEBYSCORE', KEYS[6], '-inf', now)
local limit = tonumber(redis.call('GET', KEYS[2]) or ARGV[3])
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
local limit = tonumber(redis.call('GET', KEYS[2]) or ARGV[3])
if ARGV[2] == 'grow' then
  local step = redis.call('EXISTS', KEYS[4]) == 1 and 1 / limit or 1
  limit = math.min({MAX_LIMIT}, limit + step)
elseif ARGV[2] == 'shrink' and redis.call('SET', KEYS[3], 1, 'NX', 'EX', {CALM_S}) then
  limit = math.max({MIN_LIMIT}, limit / 2)
  redis.call('SET', KEYS[4], 1, 'EX', {LIMIT_STORED_S})
end
redis.call('SET', KEYS[2], tostring(limit), 'EX', {LIMIT_STORED_S})
if redis.call('EXISTS', KEYS[5]) == 0 and redis.call('ZCARD', KEYS[1]) <= math.floor(limit) then
  return 1
end
for _, open in ipairs({{KEYS[1], KEYS[6]}}) do redis.call('ZREM', open, ARGV[1]) end
return 0
"""
_RENEW = """
local now = tonumber(redis.call('TIME')[1])
for place = 2, #ARGV do
  for _, open in ipairs({KEYS[1], KEYS[6]}) do
    redis.call('ZADD', open, 'XX', now + ARGV[1], ARGV[place])
  end
end
redis.call('EXPIRE', KEYS[6], ARGV[1])
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
        self._prefix = f"buildarena:throttle:{provider}:"
        self._keys = [self._prefix + part for part in _PARTS]
        self._start = start
        self._taken: dict[str, str] = {}  # owners by slot
        self._spare: defaultdict[str, deque[tuple[str, float]]] = defaultdict(deque)
        self._renewing: asyncio.Task[None] | None = None
        self._closed = False

    @asynccontextmanager
    async def slot(self, owner: str = "") -> AsyncIterator[Slot]:
        """Waits for a free slot and keeps it inside the block; say there how it went.

        Args:
            owner: Whose request it is.
        """
        slot = Slot()
        taken = None if self._store is None else await self._take(self._store, owner)
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
        for slot_id in list(self._taken):
            self._free(self._store, slot_id)
        await self._store.close()

    async def _take(self, store: BatchedRedis, owner: str) -> str | None:
        """The id of a slot; None when the store fails, without which requests go on."""
        slot_id, standing = uuid.uuid4().hex, "new"
        while not self._spare[owner]:
            try:
                given = slot_id, SLOT_TTL_S, self._start, standing
                if await self._eval(store, _TAKE, owner, *given):
                    self._add(store, slot_id, owner)
                    return slot_id
            except asyncio.CancelledError:  # it may have been taken all the same
                self._taken[slot_id] = owner
                self._free(store, slot_id)
                raise
            except Exception:  # noqa: BLE001 - the store has logged it
                return None
            standing = "waiting"
            await asyncio.sleep(random.uniform(*RETRY_S))  # noqa: S311 - spreads waits
        return self._spare[owner].pop()[0]

    def _give(self, store: BatchedRedis, slot_id: str, verdict: str) -> None:
        """Frees a slot soon; the request that had it does not wait for that."""

        def received(answer: asyncio.Future[Any]) -> None:
            if answer.cancelled() or answer.exception() is not None or not answer.result():
                self._taken.pop(slot_id, None)
                return
            loop = asyncio.get_running_loop()
            self._spare[owner].append((slot_id, loop.time()))
            loop.call_later(SPARE_S, self._return_spares, store, owner)

        owner = self._taken[slot_id]
        answer = self._eval(store, _GIVE, owner, slot_id, verdict, self._start)
        answer.add_done_callback(received)

    def _return_spares(self, store: BatchedRedis, owner: str) -> None:
        """Gives back the owner's slots that nobody has wanted for a while."""
        if self._closed:
            return
        spare = self._spare[owner]
        oldest = asyncio.get_running_loop().time() - SPARE_S
        while spare and spare[0][1] <= oldest:
            self._free(store, spare.popleft()[0])
        if not spare:
            del self._spare[owner]

    def _free(self, store: BatchedRedis, slot_id: str) -> None:
        owner = self._taken.pop(slot_id)
        for key in (self._keys[0], self._open_of(owner)):
            store.execute_nowait("ZREM", key, slot_id)

    def _open_of(self, owner: str) -> str:
        """Key of the owner's open slots."""
        return f"{self._prefix}open:{owner}"

    def _add(self, store: BatchedRedis, slot_id: str, owner: str) -> None:
        self._taken[slot_id] = owner
        if self._renewing is None or self._renewing.done():
            self._renewing = asyncio.create_task(self._renew(store))

    async def _renew(self, store: BatchedRedis) -> None:
        while self._taken:
            await asyncio.sleep(SLOT_TTL_S / 3)
            with suppress(Exception):  # the store has logged it; the next time may do
                for owner in set(self._taken.values()):
                    slots = [slot_id for slot_id, whose in self._taken.items() if whose == owner]
                    await self._eval(store, _RENEW, owner, SLOT_TTL_S, *slots)

    def _eval(
        self, store: BatchedRedis, script: str, owner: str, *arguments: Any
    ) -> asyncio.Future[Any]:
        keys = [*self._keys, self._open_of(owner)]
        return store.execute("EVAL", script, len(keys), *keys, *arguments)


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
