from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable

from support.servers.stacks import wait_until

from buildarena_pipeline.breakers import AsyncCircuitBreaker, CircuitBreaker

SOON_S = 0.01
ANSWERS: list[bool | Exception] = [False, OSError("refused"), RuntimeError("?"), True]
"""A server that is not there, a probe that breaks, and the server again."""


def scripted(asked: list[int]) -> Callable[[], bool]:
    def probe() -> bool:
        asked.append(threading.get_ident())
        answer = ANSWERS[(len(asked) - 1) % len(ANSWERS)]
        if isinstance(answer, Exception):
            raise answer
        return answer

    return probe


def test_a_breaker_is_open_until_a_probe_is_answered() -> None:
    asked: list[int] = []
    breaker = CircuitBreaker(scripted(asked), period_s=SOON_S)
    assert not breaker.is_open
    for times in (1, 2):
        breaker.failed()
        breaker.failed()
        assert breaker.is_open
        wait_until(lambda: not breaker.is_open, 5, "the breaker closes")
        assert len(asked) == times * len(ANSWERS)
    breaker.close()
    breaker.failed()
    assert not breaker.is_open


def test_as_is_one_of_coroutines() -> None:
    asked: list[int] = []
    script = scripted(asked)

    async def probe() -> bool:
        return script()

    async def main() -> None:
        breaker = AsyncCircuitBreaker(probe, period_s=SOON_S)
        assert not breaker.is_open
        for times in (1, 2):
            breaker.failed()
            breaker.failed()
            assert breaker.is_open
            for _ in range(500):
                await asyncio.sleep(SOON_S * breaker.is_open)
            assert not breaker.is_open
            assert len(asked) == times * len(ANSWERS)
        await breaker.close()
        breaker.failed()
        assert not breaker.is_open

    asyncio.run(main())


def test_one_that_is_open_closes_at_once() -> None:
    breaker = CircuitBreaker(lambda: False, period_s=60)
    breaker.failed()
    breaker.close()
    assert not breaker.is_open

    async def main() -> None:
        own = AsyncCircuitBreaker(asyncio.Event().wait, period_s=60)
        own.failed()
        async with asyncio.timeout(5):
            await own.close()
        assert asyncio.all_tasks() == {asyncio.current_task()}

    asyncio.run(main())


def test_a_probe_that_swallows_its_cancellation_ends_too() -> None:
    probing = asyncio.Event()

    async def probe() -> bool:
        probing.set()
        try:
            await asyncio.sleep(60)
        except asyncio.CancelledError:
            return False
        return True

    async def main() -> None:
        breaker = AsyncCircuitBreaker(probe, period_s=SOON_S)
        breaker.failed()
        async with asyncio.timeout(5):
            await probing.wait()
            await breaker.close()
        assert asyncio.all_tasks() == {asyncio.current_task()}

    asyncio.run(main())
