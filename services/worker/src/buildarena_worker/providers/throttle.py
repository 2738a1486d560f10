"""Adaptive limit on the open requests at a provider, over all workers.

It halves when the provider reports too many requests, and grows by about one
for each limit's worth of answers (additive increase, multiplicative decrease; Chiu and Jain,
1989). Until the provider's limit was met once, it grows by one with each answer (slow start).
It is stored in the broker's key-value store; without the store, requests are not limited.

An owner (an API key) without an open request at the provider may always send one, so that requests
of one owner that hang do not block others. Requests of one owner in one process wait in line: slots
are taken for all of them, one at a time once one was refused; meanwhile requests that come later
wait too, everywhere.

A process renews its slots; those of a process that died expire.
"""

from __future__ import annotations

import asyncio
import random
import time
import uuid
from collections import defaultdict
from collections.abc import AsyncIterator, Callable
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
MAX_TAKEN = 100
"""Slots that one script takes."""
AWAY_S = 10.0
"""Time that a store is not used after it failed."""

_PARTS = ("open", "limit", "calm", "met", "refused")
_TAKE = f"""
local now = tonumber(redis.call('TIME')[1])
redis.call('ZREMRANGEBYSCORE', KEYS[1], '-inf', now)
redis.call('ZREMRANGEBYSCORE', KEYS[6], '-inf', now)
local limit = math.min(tonumber(redis.call('GET', KEYS[2]) or ARGV[2]), tonumber(ARGV[4]))
local granted = 0
for place = 5, #ARGV do
  if redis.call('ZCARD', KEYS[1]) >= math.floor(limit) then
    if redis.call('ZCARD', KEYS[6]) > 0 then
      redis.call('SET', KEYS[5], 1, 'PX', {REFUSED_MS})
      break
    end
  elseif ARGV[3] == 'new' and redis.call('EXISTS', KEYS[5]) == 1 then
    break
  end
  for _, open in ipairs({{KEYS[1], KEYS[6]}}) do
    redis.call('ZADD', open, now + ARGV[1], ARGV[place])
  end
  granted = granted + 1
end
redis.call('EXPIRE', KEYS[6], ARGV[1])
return granted
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
        self._lines: defaultdict[str, dict[str, asyncio.Future[None]]] = defaultdict(dict)
        self._unsent: list[tuple[tuple[Any, ...], asyncio.Future[Any]]] = []
        self._tasks: dict[str, asyncio.Task[None]] = {}
        self._away_until = 0.0
        self._open: dict[str, str] = {}  # owners by slot

    @asynccontextmanager
    async def slot(self, owner: str = "") -> AsyncIterator[Slot]:
        """Wait for a free slot, and hold it inside the block, which reports the result to it."""
        slot, id_, line = Slot(), uuid.uuid4().hex, self._lines[owner]
        granted = line[id_] = asyncio.get_running_loop().create_future()
        self._start_task(f"line of {owner}", self._serve, owner)
        try:
            await granted
            yield slot
        finally:  # a request that was cancelled while it waited may have a slot
            line.pop(id_, None)
            self._open.pop(id_, None)
            await self._ask(_GIVE, owner, id_, self._start, slot.verdict, self._maximum)

    async def close(self) -> None:
        """Release all slots and close the connection."""
        if (renewal := self._tasks.get("renewal")) is not None:
            renewal.cancel()
            await asyncio.gather(renewal, return_exceptions=True)
        for id_, owner in list(self._open.items()):
            await self._ask(_GIVE, owner, id_, self._start, "keep", self._maximum)
        if self._store is not None:
            await self._store.aclose()

    def _start_task(self, name: str, work: Callable[..., Any], *arguments: str) -> None:
        """Start work in the background, unless it runs."""
        if name not in self._tasks or self._tasks[name].done():
            self._tasks[name] = asyncio.create_task(work(*arguments))

    async def _serve(self, owner: str) -> None:
        """Take slots for all requests in an owner's line, one at a time once one was refused.

        Requests are not limited while the store fails.
        """
        line, state = self._lines[owner], "new"
        while line:
            ids = list(line)[: MAX_TAKEN if state == "new" else 1]
            limits = SLOT_TTL_S, self._start, state, self._maximum
            answer = await self._ask(_TAKE, owner, *limits, *ids)
            granted = ids if answer is None else ids[:answer]
            for id_ in granted:
                if (waiting := line.pop(id_, None)) is not None and not waiting.done():
                    waiting.set_result(None)
                    self._open[id_] = owner
                    self._start_task("renewal", self._renew)
            state = "new" if len(granted) == len(ids) else "waiting"
            if state == "waiting":
                await asyncio.sleep(random.uniform(*RETRY_S))  # noqa: S311 - spreads waits

    async def _renew(self) -> None:
        while self._open:
            await asyncio.sleep(SLOT_TTL_S / 3)
            for id_, owner in list(self._open.items()):
                await self._ask(_RENEW, owner, id_, SLOT_TTL_S)

    async def _ask(self, script: str, owner: str, *arguments: Any) -> Any:
        """Return the result of a script; None without a working store."""
        if self._store is None or time.monotonic() < self._away_until:
            return None
        keys = [self._prefix + part for part in (*_PARTS, f"open:{owner}")]
        answer = asyncio.get_running_loop().create_future()
        self._unsent.append(((script, len(keys), *keys, *arguments), answer))
        self._start_task("sending", self._send)
        return await answer

    async def _send(self) -> None:
        """Send what was asked since the last answers, all at once and in order."""
        while self._unsent:
            asked, self._unsent = self._unsent, []
            answers: list[Any] = [None] * len(asked)
            if time.monotonic() >= self._away_until:
                pipeline = self._store.pipeline(transaction=False)
                for command, _ in asked:
                    pipeline.eval(*command)
                try:
                    answers = await pipeline.execute()
                except (RedisError, OSError) as error:
                    self._away_until = time.monotonic() + AWAY_S
                    log.warning("store_failed", error=str(error))
            for (_, waiting), answer in zip(asked, answers, strict=True):
                if not waiting.done():
                    waiting.set_result(answer)


@dataclass
class Slot:
    """An open request.

    Attributes:
        verdict: Effect of its result on the limit: "keep", "grow" or "shrink".
    """

    verdict: str = "keep"
