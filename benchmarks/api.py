"""What the API carries on this machine, over real HTTP on loopback. Prints medians as JSON.

The bars: a sweep of 10,000 jobs accepted in less than 5 s; single jobs at 50 a second with a 99th
percentile below 100 ms; 500 listeners of one sweep's events; at most 15 ms of processor time a
job for everything but session and simulation.
"""

import argparse
import asyncio
import contextlib
import os
import statistics
import time
from pathlib import Path
from typing import Any

import httpx
import psutil
from benchmarks.figures import tell
from benchmarks.overhead import measure_overhead
from support.servers.api_process import api_process

MEBIBYTE = 1024 * 1024
SWEEP = {"tasks": ["lift-1"], "models": ["builtin/idle"], "simulator": "mujoco"}
ROUNDS = 3
STREAMS_OF_A_CALLER = 32
"""Event streams that the API allows an address without a key."""


def main() -> None:
    """Runs the benchmark and prints its figures."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--jobs", type=int, default=10_000, help="jobs of the large sweep")
    parser.add_argument("--rate", type=float, default=50.0, help="submissions per second")
    parser.add_argument("--seconds", type=float, default=20.0, help="how long to submit")
    parser.add_argument("--listeners", type=int, default=500)
    parser.add_argument("--overhead-jobs", type=int, default=500)
    parser.add_argument("--json", type=Path, help="also write the figures to this file")
    given = parser.parse_args()
    figures: dict[str, Any] = {"load_average_before": os.getloadavg()[0]}
    with api_process() as (url, pid):
        figures["large_sweep"] = _large_sweeps(url, given.jobs)
        asyncio.run(_submit_steadily(url, given.rate, 1, "lift-3"))  # warm
        figures["submitting"] = asyncio.run(_submit_steadily(url, given.rate, given.seconds))
        figures["listeners"] = asyncio.run(_listen(url, given.listeners, psutil.Process(pid)))
    figures["overhead"] = measure_overhead(given.overhead_jobs)
    tell(figures, given.json)


def _large_sweeps(url: str, jobs: int) -> dict[str, Any]:
    times = []
    with httpx.Client(base_url=url, timeout=120) as client:
        for number in range(ROUNDS):
            seeds = list(range(number * jobs, (number + 1) * jobs))
            started = time.perf_counter()
            answer = client.post("/v1/sweeps", json={**SWEEP, "seeds": seeds})
            times.append(time.perf_counter() - started)
            assert answer.status_code == 201, answer.text
            assert answer.json()["added"] == jobs
            client.post(f"/v1/sweeps/{answer.json()['id']}/cancel").raise_for_status()
    median = statistics.median(times)
    return {"jobs": jobs, "accepted_s": round(median, 3), "bar_s": 5, "ratio": round(median / 5, 3)}


async def _submit_steadily(
    url: str, rate: float, seconds: float, task: str = "lift-2"
) -> dict[str, Any]:
    """Submits at a fixed rate, whether or not earlier answers have come."""
    latencies: list[float] = []
    limits = httpx.Limits(max_connections=100)
    async with httpx.AsyncClient(base_url=url, timeout=30, limits=limits) as client:

        async def submit(number: int) -> None:
            body = {"task": task, "model": "builtin/idle", "seed": number}
            started = time.perf_counter()
            answer = await client.post("/v1/jobs", json=body)
            latencies.append(time.perf_counter() - started)
            assert answer.status_code == 201, answer.text

        async with asyncio.TaskGroup() as tasks:
            begun = time.perf_counter()
            for number in range(round(rate * seconds)):
                await asyncio.sleep(max(0.0, begun + number / rate - time.perf_counter()))
                tasks.create_task(submit(number))
    latencies.sort()
    p99 = latencies[int(0.99 * len(latencies))] * 1000
    return {
        "per_second": rate,
        "requests": len(latencies),
        "p50_ms": round(statistics.median(latencies) * 1000, 1),
        "p99_ms": round(p99, 1),
        "bar_ms": 100,
        "ratio": round(p99 / 100, 3),
    }


async def _listen(url: str, listeners: int, process: psutil.Process) -> dict[str, Any]:
    """Opens streams of one sweep, has something happen, and waits until all have heard of it."""
    async with contextlib.AsyncExitStack() as opened:
        clients = [
            await opened.enter_async_context(
                httpx.AsyncClient(
                    base_url=url,
                    timeout=60,
                    transport=httpx.AsyncHTTPTransport(local_address=f"127.0.0.{number + 1}"),
                )
            )
            for number in range(-(-listeners // STREAMS_OF_A_CALLER) + 1)
        ]
        client = clients.pop()
        payload = {**SWEEP, "seeds": [10_000_000, 10_000_001]}
        sweep_id = (await client.post("/v1/sweeps", json=payload)).json()["id"]
        memory_before = process.memory_info().rss
        connected = asyncio.Semaphore(0)
        heard: list[float] = []

        async def listen(client: httpx.AsyncClient) -> None:
            async with client.stream("GET", f"/v1/sweeps/{sweep_id}/events") as answer:
                assert answer.status_code == 200
                connected.release()
                async for line in answer.aiter_lines():
                    if line == "event: cancelled":
                        heard.append(time.perf_counter())
                        return

        started = time.perf_counter()
        async with asyncio.TaskGroup() as tasks:
            for number in range(listeners):
                tasks.create_task(listen(clients[number % len(clients)]))
            for _ in range(listeners):
                await connected.acquire()
            connected_s = time.perf_counter() - started
            memory = process.memory_info().rss - memory_before
            happened = time.perf_counter()
            (await client.post(f"/v1/sweeps/{sweep_id}/cancel")).raise_for_status()
        delays = sorted(moment - happened for moment in heard)
    return {
        "listeners": listeners,
        "received": len(delays),
        "all_connected_s": round(connected_s, 2),
        "median_delay_s": round(statistics.median(delays), 3),
        "longest_delay_s": round(delays[-1], 3),
        "memory_mib": round(memory / MEBIBYTE, 1),
    }


if __name__ == "__main__":
    main()
