from __future__ import annotations

import asyncio
import time

from buildarena_worker.llm.throttle import Throttle


def test_no_more_than_the_limit_is_open_at_once_over_all_workers(context, broker_url) -> None:
    open_now, most = 0, 0

    async def request(throttle: Throttle) -> None:
        nonlocal open_now, most
        async with throttle.slot():
            open_now += 1
            most = max(most, open_now)
            await asyncio.sleep(0.02)
            open_now -= 1

    async def main() -> None:
        workers = [Throttle(broker_url, "p", start=3) for _ in range(2)]
        await asyncio.gather(*(request(workers[n % 2]) for n in range(20)))
        for worker in workers:
            await worker.close()

    asyncio.run(main())
    assert most == 3
    del context


def test_hundreds_of_requests_at_once_keep_to_the_limit(context, broker_url) -> None:
    open_now, most = 0, 0

    async def request(throttle: Throttle) -> None:
        nonlocal open_now, most
        async with throttle.slot():
            open_now += 1
            most = max(most, open_now)
            await asyncio.sleep(0.3)
            open_now -= 1

    async def main() -> None:
        throttle = Throttle(broker_url, "p", start=150)
        await asyncio.gather(*(request(throttle) for _ in range(300)))
        await throttle.close()

    asyncio.run(main())
    assert most == 150
    del context


def test_the_limit_halves_on_complaints_and_grows_with_answers(context, broker_url) -> None:
    async def main() -> list[float]:
        throttle = Throttle(broker_url, "p", start=8)
        limits = [await throttle.limit()]
        for _ in range(2):  # at the same time: one complaint
            async with throttle.slot() as slot:
                slot.was_too_much()
        limits.append(await throttle.limit())
        for _ in range(4):
            async with throttle.slot() as slot:
                slot.went_well()
        limits.append(await throttle.limit())
        await throttle.close()
        return limits

    start, halved, grown = asyncio.run(main())
    assert (start, halved) == (8, 4)
    assert 4.9 < grown < 5
    del context


def test_requests_go_on_when_the_store_is_gone() -> None:
    async def main() -> None:
        throttle = Throttle("redis://127.0.0.1:1/0", "p")
        async with throttle.slot() as slot:
            slot.went_well()
        await throttle.close()

    started = time.monotonic()
    asyncio.run(main())
    assert time.monotonic() - started < 30
