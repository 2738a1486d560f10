"""How many requests may be open at a provider at once, over all workers.

The limit adapts: it halves when the provider says that it is too much, and grows by about one
for each limit's worth of answers (additive increase, multiplicative decrease; Chiu and Jain,
1989). Until the provider's limit was met once, it grows by one with each answer (slow start).
It lives in the broker's key-value store; without it, each process goes on by itself.

A process gathers what its requests want for a few milliseconds and asks the store for all of it
in one message over one connection, because a message costs more than what it asks for.
"""

from __future__ import annotations

import asyncio
import random
import uuid
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import structlog
from redis.asyncio import Redis

log = structlog.get_logger(__name__)

START, LEAST, MOST = 64.0, 1.0, 2048.0
HOLD_S = 900
"""A slot whose holder died is free again after this time; no request may take longer."""
CALM_S = 2
"""Several complaints within this time count as one: they speak of the same crowd."""
GATHER_S = 0.005
"""How long what is to be asked gathers before it is sent: little beside a model's seconds."""

_TAKE = """
local now = tonumber(redis.call('TIME')[1])
redis.call('ZREMRANGEBYSCORE', KEYS[1], '-inf', now)
local limit = tonumber(redis.call('GET', KEYS[2]) or ARGV[3])
if redis.call('ZCARD', KEYS[1]) >= math.floor(limit) then return 0 end
redis.call('ZADD', KEYS[1], now + tonumber(ARGV[2]), ARGV[1])
redis.call('EXPIRE', KEYS[1], tonumber(ARGV[2]) * 2)
return 1
"""
_GIVE = """
redis.call('ZREM', KEYS[1], ARGV[1])
local limit = tonumber(redis.call('GET', KEYS[2]) or ARGV[3])
if ARGV[2] == 'grow' then
  local step = redis.call('EXISTS', KEYS[4]) == 1 and 1 / limit or 1
  limit = math.min(tonumber(ARGV[5]), limit + step)
elseif ARGV[2] == 'shrink' and redis.call('SET', KEYS[3], 1, 'NX', 'EX', ARGV[6]) then
  limit = math.max(tonumber(ARGV[4]), limit / 2)
  redis.call('SET', KEYS[4], 1, 'EX', 86400)
end
redis.call('SET', KEYS[2], tostring(limit), 'EX', 86400)
return tostring(limit)
"""


class Throttle:
    """The shared limit of one provider.

    Args:
        url: ``redis://…`` of the key-value store, or None to never wait.
        provider: The provider's name.
        start: The limit to begin with.
    """

    def __init__(self, url: str | None, provider: str, *, start: float = START) -> None:
        self._redis: Any = None if url is None else Redis.from_url(url, socket_timeout=5)
        self._keys = [
            f"buildarena:throttle:{provider}:{part}" for part in ("open", "limit", "calm", "met")
        ]
        self._start = start
        self._asked: list[tuple[tuple[Any, ...], asyncio.Future[Any]]] = []
        self._sender: asyncio.Task[None] | None = None

    @asynccontextmanager
    async def slot(self) -> AsyncIterator[Slot]:
        """Waits for a free slot and holds it inside the block; say there how it went."""
        slot = Slot()
        taken = await self._take(slot.id)
        try:
            yield slot
        finally:
            if taken:
                self._give(slot)

    async def limit(self) -> float:
        """The limit now."""
        raw = None if self._redis is None else await self._ask("GET", self._keys[1])
        return self._start if raw is None else float(raw)

    async def close(self) -> None:
        """Closes the connections, after what is still to be said."""
        if self._sender is not None:
            await self._sender
        if self._redis is not None:
            await self._redis.aclose()

    async def _take(self, slot_id: str) -> bool:
        while self._redis is not None:
            try:
                arguments = [slot_id, HOLD_S, self._start]
                if await self._ask("EVAL", _TAKE, 2, *self._keys[:2], *arguments):
                    return True
            except Exception:  # noqa: BLE001 - logged; requests go on without the limit
                return False
            await asyncio.sleep(random.uniform(0.02, 0.1))  # noqa: S311 - spreads waits
        return False

    def _give(self, slot: Slot) -> None:
        """Frees a slot soon; the request that held it does not wait for that."""
        arguments = [slot.id, slot.verdict, self._start, LEAST, MOST, CALM_S]
        told = self._ask("EVAL", _GIVE, 4, *self._keys, *arguments)
        told.add_done_callback(asyncio.Future.exception)  # logged; the slot expires by itself

    def _ask(self, *command: Any) -> asyncio.Future[Any]:
        """The store's answer to a command, in order with all others."""
        answer: asyncio.Future[Any] = asyncio.get_running_loop().create_future()
        self._asked.append((command, answer))
        if self._sender is None:
            self._sender = asyncio.create_task(self._send())
        return answer

    async def _send(self) -> None:
        while self._asked:
            await asyncio.sleep(GATHER_S)
            asked, self._asked = self._asked, []
            pipeline = self._redis.pipeline(transaction=False)
            for command, _ in asked:
                pipeline.execute_command(*command)
            answers: list[Any]
            try:
                answers = await pipeline.execute(raise_on_error=False)
            except Exception as error:  # noqa: BLE001 - whatever it is, nobody may wait forever
                answers = [error] * len(asked)
            errors = [answer for answer in answers if isinstance(answer, Exception)]
            if errors:
                log.warning("throttle_failed", requests=len(errors), error=str(errors[0]))
            for (_, waiting), answer in zip(asked, answers, strict=True):
                if waiting.done():  # who asked was cancelled
                    continue
                if isinstance(answer, Exception):
                    waiting.set_exception(answer)
                else:
                    waiting.set_result(answer)
        self._sender = None


class Slot:
    """One open request."""

    def __init__(self) -> None:
        self.id = uuid.uuid4().hex
        self.verdict = "keep"

    def went_well(self) -> None:
        """The provider answered: it may take a little more."""
        self.verdict = "grow"

    def was_too_much(self) -> None:
        """The provider complained of the load: halve it."""
        self.verdict = "shrink"
