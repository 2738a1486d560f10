"""How many requests are open at once, over all workers; the loop that sends them."""

import asyncio
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import pytest
from redis import Redis
from support.servers.stacks import wait_until

from buildarena_worker.providers import throttle as throttle_module
from buildarena_worker.providers.provider import RequestLoop
from buildarena_worker.providers.throttle import Throttle

pytestmark = pytest.mark.usefixtures("context")


@pytest.mark.parametrize("limits", [{"start": 3}, {"maximum": 3}])
def test_no_more_than_the_limit_is_open_at_once_over_all_workers(broker_url, limits) -> None:
    open_now, most = 0, 0

    async def request(throttle: Throttle) -> None:
        nonlocal open_now, most
        async with throttle.slot() as slot:
            open_now += 1
            most = max(most, open_now)
            await asyncio.sleep(0.02)
            open_now -= 1
            if "maximum" in limits:
                slot.verdict = "grow"

    async def main() -> None:
        workers = [Throttle(broker_url, "p", **limits) for _ in range(2)]
        await asyncio.gather(*(request(workers[n % 2]) for n in range(20)))
        for worker in workers:
            await worker.close()

    asyncio.run(main())
    assert most == 3


def test_the_limit_halves_on_complaints_and_grows_with_answers(broker_url) -> None:
    def limit() -> float:
        with Redis.from_url(broker_url) as store:
            return float(store.get("buildarena:throttle:p:limit"))

    async def main() -> list[float]:
        throttle = Throttle(broker_url, "p", start=8)
        limits = []
        for _ in range(2):  # at the same time: one complaint
            async with throttle.slot() as slot:
                slot.verdict = "shrink"
        limits.append(limit())
        for _ in range(4):
            async with throttle.slot() as slot:
                slot.verdict = "grow"
        limits.append(limit())
        await throttle.close()
        return limits

    halved, grown = asyncio.run(main())
    assert halved == 4
    assert 4.9 < grown < 5


HOLDER = """
import asyncio, sys
from buildarena_worker.providers import throttle
throttle.SLOT_TTL_S = 1

async def hold():
    async with throttle.Throttle(sys.argv[1], "p", start=1).slot():
        print("taken", flush=True)
        await asyncio.sleep(60)

asyncio.run(hold())
"""


def open_slots(broker_url: str) -> int:
    with Redis.from_url(broker_url) as store:
        return store.zcard("buildarena:throttle:p:open")


def test_a_busy_worker_leaves_slots_to_others(broker_url) -> None:
    async def main() -> bool:
        busy, other = (Throttle(broker_url, "p", start=1) for _ in range(2))
        served = asyncio.Event()

        async def keep_busy() -> None:
            while not served.is_set():
                async with busy.slot() as slot:
                    await asyncio.sleep(0.01)
                    slot.verdict = "keep"

        working = asyncio.create_task(keep_busy())
        await asyncio.sleep(0.1)
        async with asyncio.timeout(10), other.slot():
            served.set()
        await working
        for throttle in (busy, other):
            await throttle.close()
        return served.is_set()

    assert asyncio.run(main())


def test_an_owner_without_an_open_request_may_send_one_whoever_hangs(broker_url) -> None:
    """Forty and more requests of one key hang; each other key may send one, over all workers."""

    async def main() -> tuple[list[float], int, int]:
        first, second = (Throttle(broker_url, "p", start=4) for _ in range(2))
        hang, waits = asyncio.Event(), []

        async def hanging(throttle: Throttle) -> None:
            async with throttle.slot("key_a"):
                await hang.wait()

        held = [asyncio.create_task(hanging(throttle)) for throttle in (first, second) * 6]
        await asyncio.sleep(0.3)
        others = []
        for number, throttle in enumerate((first, second)):
            started = time.monotonic()
            slot = throttle.slot(f"key_{number}")
            await slot.__aenter__()
            others.append(slot)
            waits.append(time.monotonic() - started)
        most = open_slots(broker_url)
        # A second request of such a key waits like everybody's.
        refused = 0
        try:
            async with asyncio.timeout(0.5), second.slot("key_0"):
                pass
        except TimeoutError:
            refused += 1
        for slot in others:
            await slot.__aexit__(None, None, None)
        hang.set()
        await asyncio.gather(*held)
        for throttle in (first, second):
            await throttle.close()
        return waits, most, refused

    waits, most, refused = asyncio.run(main())
    assert max(waits) < 2
    assert (most, refused) == (6, 1)
    assert open_slots(broker_url) == 0


@pytest.mark.ci
def test_slots_of_a_dead_worker_are_free_again_soon(broker_url, monkeypatch) -> None:
    monkeypatch.setattr(throttle_module, "SLOT_TTL_S", 1)

    async def come_after() -> int:
        throttle = Throttle(broker_url, "p", start=1)
        async with asyncio.timeout(10), throttle.slot():
            await asyncio.sleep(2)  # renewed meanwhile
            open_now = open_slots(broker_url)
        await throttle.close()
        return open_now

    words = [sys.executable, "-c", HOLDER, broker_url]
    with subprocess.Popen(words, stdout=subprocess.PIPE) as holder:
        assert holder.stdout is not None
        holder.stdout.readline()
        holder.kill()
    assert open_slots(broker_url) == 1
    assert asyncio.run(come_after()) == 1
    assert open_slots(broker_url) == 0


def test_a_request_that_is_given_up_gives_its_slot_back(broker_url) -> None:
    async def main() -> None:
        throttle = Throttle(broker_url, "p", start=1)

        async def hold() -> None:
            async with throttle.slot():
                await asyncio.sleep(60)

        held = [asyncio.create_task(hold()) for _ in range(3)]  # one sends, two wait
        await asyncio.to_thread(wait_until, lambda: open_slots(broker_url), 5, "a slot is open")
        await asyncio.sleep(0.2)
        assert open_slots(broker_url) == 1
        for task in held:
            task.cancel()
        await asyncio.gather(*held, return_exceptions=True)
        async with asyncio.timeout(5), throttle.slot():
            assert open_slots(broker_url) == 1
        await throttle.close()

    asyncio.run(main())
    assert open_slots(broker_url) == 0


def test_requests_go_on_when_the_store_is_gone() -> None:
    async def main() -> None:
        throttle = Throttle("redis://127.0.0.1:1/0", "p")
        async with throttle.slot() as slot:
            slot.verdict = "grow"
        await throttle.close()

    started = time.monotonic()
    asyncio.run(main())
    assert time.monotonic() - started < 30


THREADS = 16


@pytest.fixture
def hurried() -> Iterator[None]:
    """Threads take turns so often that they meet everywhere, not only by luck."""
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(interval)


@pytest.mark.usefixtures("hurried")
def test_threads_that_start_at_once_share_one_loop() -> None:
    assert [_loops_made() for _ in range(20)] == [1] * 20


def _loops_made() -> int:
    requests, together = RequestLoop(), threading.Barrier(THREADS)

    async def running() -> asyncio.AbstractEventLoop:
        return asyncio.get_running_loop()

    def first_request() -> asyncio.AbstractEventLoop:
        together.wait()
        return requests.run(running())

    with ThreadPoolExecutor(THREADS) as threads:
        loops = {job.result() for job in [threads.submit(first_request) for _ in range(THREADS)]}
    for loop in loops:
        loop.call_soon_threadsafe(loop.stop)
        while loop.is_running():
            time.sleep(0.001)
        loop.close()
    return len(loops)
