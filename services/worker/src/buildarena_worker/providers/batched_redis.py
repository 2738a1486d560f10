"""A key-value store whose commands are collected for some milliseconds and sent in one message.

A message costs more than what it asks for, and hundreds of requests want something each second.
"""

from __future__ import annotations

import asyncio
from typing import Any

import structlog
from redis.asyncio import Redis
from redis.asyncio.retry import Retry
from redis.backoff import NoBackoff
from redis.exceptions import RedisError

from buildarena_backend.queue.breakers import AsyncCircuitBreaker

log = structlog.get_logger(__name__)

TIMEOUT_S = 1.0
BATCH_S = 0.005
"""How long commands are collected: little beside a model's seconds."""


class BatchedRedis:
    """Sends the commands of one event loop in batches over one connection, in their order.

    After a failure commands fail at once, until a probe in the background is answered: a store
    that was stopped costs one time-out, not one for each command.

    Args:
        url: ``redis://…``.
    """

    def __init__(self, url: str) -> None:
        self._redis: Any = Redis.from_url(
            url,
            socket_timeout=TIMEOUT_S,
            socket_connect_timeout=TIMEOUT_S,
            retry=Retry(NoBackoff(), 0),
        )
        self._breaker = AsyncCircuitBreaker(self._answers_again)
        self._waiting: list[tuple[tuple[Any, ...], asyncio.Future[Any]]] = []
        self._sender: asyncio.Task[None] | None = None

    def execute(self, *command: Any) -> asyncio.Future[Any]:
        """The store's answer to a command; failures are logged here and raised there."""
        answer: asyncio.Future[Any] = asyncio.get_running_loop().create_future()
        if self._breaker.is_open:
            answer.set_exception(ConnectionError("the store does not answer"))
            return answer
        self._waiting.append((command, answer))
        if self._sender is None or self._sender.done():
            self._sender = asyncio.create_task(self._send())
        return answer

    def execute_nowait(self, *command: Any) -> None:
        """Sends a command whose answer nobody waits for."""
        self.execute(*command).add_done_callback(_unread)

    async def close(self) -> None:
        """Closes the connection, after what is still to be sent."""
        if self._sender is not None:
            await self._sender
        await self._breaker.close()
        await self._redis.aclose()

    async def _send(self) -> None:
        while self._waiting:
            await asyncio.sleep(BATCH_S)
            batch, self._waiting = self._waiting, []
            answers: list[Any] = [ConnectionError("the command was not sent")] * len(batch)
            try:
                answers = await self._answers([command for command, _ in batch])
            finally:  # whatever happens, nobody may wait forever
                _deliver([answer for _, answer in batch], answers)

    async def _answers(self, commands: list[tuple[Any, ...]]) -> list[Any]:
        pipeline = self._redis.pipeline(transaction=False)
        for command in commands:
            pipeline.execute_command(*command)
        try:
            answers: list[Any] = await pipeline.execute(raise_on_error=False)
        except Exception as error:  # noqa: BLE001 - raised where the answers are waited for
            answers = [error] * len(commands)
            self._breaker.failed()
        errors = [answer for answer in answers if isinstance(answer, Exception)]
        if errors:
            log.warning("store_failed", commands=len(errors), error=str(errors[0]))
        return answers

    async def _answers_again(self) -> bool:
        try:
            return bool(await self._redis.ping())
        except (RedisError, OSError):
            return False


def _deliver(waiting: list[asyncio.Future[Any]], answers: list[Any]) -> None:
    for future, answer in zip(waiting, answers, strict=True):
        if future.done():  # its caller was cancelled
            continue
        if isinstance(answer, Exception):
            future.set_exception(answer)
        else:
            future.set_result(answer)


def _unread(answer: asyncio.Future[Any]) -> None:
    if not answer.cancelled():
        answer.exception()
