from __future__ import annotations

import asyncio
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import pytest

from buildarena_worker.providers.request_loop import RequestLoop

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
