"""The broker: messages, and that one which is away, stopped or behind a dead link slows nobody."""

import asyncio
import os
import queue
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import httpx
import pytest
import uvloop
from celery.signals import task_received
from redis.asyncio import Redis
from support.servers.live_api import changed, live_api
from support.servers.stacks import wait_until

from buildarena_api.http import places
from buildarena_api.http.rate_limits import RateLimits
from buildarena_backend.process.active_lease import LeaseKeeper
from buildarena_backend.queue.consumer import ConsumerWatchdog, reconnect
from buildarena_backend.queue.queues import MAX_WAITING, Queues
from buildarena_cli.local.server import EmbeddedValkey
from buildarena_worker.providers import throttle as throttle_module
from buildarena_worker.providers.throttle import Throttle

QUICK_S = 1.0
SOON_S = 0.01
JOB = {"task": "support-1", "model": "builtin/idle"}


@pytest.fixture
def valkey(tmp_path) -> Iterator[tuple[str, int]]:
    """The URL and process id of a broker of this test's own."""
    server = EmbeddedValkey(tmp_path / "valkey", tmp_path / "valkey.log")
    process = server.start()
    yield server.url, process.pid
    os.kill(process.pid, signal.SIGCONT)
    server.stop(process)


@contextmanager
def stopped(pid: int) -> Iterator[None]:
    """Stopped, not killed: it takes connections and says nothing."""
    os.kill(pid, signal.SIGSTOP)
    try:
        yield
    finally:
        os.kill(pid, signal.SIGCONT)


@pytest.mark.ci
def test_requests_are_quick_beside_a_stopped_broker_and_jobs_go_on(
    context, valkey, monkeypatch
) -> None:
    # Refusals are held back by up to a second on purpose, which is not what is measured here.
    monkeypatch.setattr(places, "HELD_S", (0.0, 0.0))
    url, pid = valkey
    with (
        changed(context, broker_url=url, rate_limit="25/minute") as own,
        live_api(own) as api,
        httpx.Client(base_url=api, timeout=30) as client,
    ):
        assert client.post("/v1/jobs", json=JOB).status_code == 201
        with stopped(pid):
            # The first to meet it pay one short time-out each: counting and announcing.
            client.post("/v1/jobs", json={**JOB, "seed": 1})
            times, answers = [], []
            for number in range(40):
                started = time.monotonic()
                job = {**JOB, "seed": 2 + number}
                answers.append(client.post("/v1/jobs", json=job).status_code)
                times.append(time.monotonic() - started)

            def says_so() -> bool:
                started = time.monotonic()
                checks = client.get("/v1/health").json()["checks"]
                times.append(time.monotonic() - started)
                broker = next(check for check in checks if check["name"] == "broker")
                return not broker["ok"] and "not reachable" in broker["detail"]

            wait_until(says_so, 20, "health says that the broker is away")
            assert max(times) < QUICK_S
            # This process counts alone meanwhile.
            assert set(answers) == {201, 429}
        wait_until(lambda: (own.queues.waiting("construct") or 0) > 20, 20, "jobs flow again")


@pytest.mark.ci
def test_provider_requests_go_on_without_waiting_each(valkey, monkeypatch) -> None:
    url, pid = valkey
    monkeypatch.setattr(throttle_module, "AWAY_S", 2.0)

    async def main() -> None:
        throttle, store = Throttle(url, "p"), Redis.from_url(url)
        async with throttle.slot() as slot:
            slot.verdict = "grow"
        times = []
        with stopped(pid):
            for _ in range(20):
                started = time.monotonic()
                async with throttle.slot() as slot:
                    slot.verdict = "grow"
                times.append(time.monotonic() - started)
        assert times[0] < 5
        assert max(times[1:]) < QUICK_S
        async with asyncio.timeout(10):
            counted = 0
            while not counted:
                async with throttle.slot():
                    counted = await store.zcard("buildarena:throttle:p:open")
                await asyncio.sleep(0.1)
        await store.aclose()
        await throttle.close()

    asyncio.run(main())


def test_messages_are_sent_again_when_the_broker_is_back(tmp_path) -> None:
    valkey = EmbeddedValkey(tmp_path / "valkey", tmp_path / "valkey.log")
    process = valkey.start()
    queues = Queues(valkey.url)

    def sent() -> int | None:
        queues.wake("construct")
        queues.settle()
        return queues.waiting("construct")

    try:
        assert sent() == 1
        valkey.stop(process)
        assert sent() is None
        process = valkey.start()
        before = sent()
        assert sent() == before + 1
    finally:
        queues.close()
        valkey.stop(process)


def test_no_more_messages_are_sent_than_are_enough(context) -> None:
    context.queues.wake("construct", MAX_WAITING - 1)
    context.queues.wake("construct", 5)
    context.queues.settle()
    for _ in range(2):
        context.queues.wake("construct", 3)
        context.queues.settle()
        assert context.queues.waiting("construct") == MAX_WAITING


def test_a_connection_that_ended_unseen_leaves_a_request_to_the_own_count(broker_url) -> None:
    async def asked() -> list[bool]:
        limits = RateLimits(broker_url, "2/minute")
        found = [(await limits.hit("dead-links")).passes]
        for connection in limits._pool._available_connections:
            connection._writer.transport.abort()
        found += [(await limits.hit("dead-links")).passes for _ in range(3)]
        await limits.close()
        return found

    first, *others = uvloop.run(asked())
    assert first
    # The process' own count begins anew.
    assert others == [True, True, False]


@pytest.mark.ci
def test_heartbeats_go_on_whatever_they_meet(context) -> None:
    beats = []

    def beat() -> None:
        beats.append(1)
        raise RuntimeError("nobody foresaw this")

    keeper = LeaseKeeper(context.store.leases, beat)
    keeper.start()
    wait_until(lambda: len(beats) >= 2, 5, "a second beat after the first failed")
    keeper.stop()


class Consumer:
    """Keeps what it is to call."""

    def __init__(self) -> None:
        self.called: queue.Queue[Any] = queue.Queue()

    def call_soon(self, callback: Any) -> None:
        self.called.put(callback)


def test_a_worker_takes_a_new_connection_when_messages_wait_and_none_comes(context) -> None:
    consumer = Consumer()
    dog = ConsumerWatchdog(context.queues, ["simulate.x"], period_s=0.02, stalled_after_s=0.1)
    dog.start(consumer)
    with pytest.raises(queue.Empty):  # nothing waits
        consumer.called.get(timeout=0.4)
    task_received.send(sender=None)
    context.queues.wake("simulate.x")
    ends = time.monotonic() + 0.4
    while time.monotonic() < ends:  # messages wait, and some come
        task_received.send(sender=None)
        time.sleep(0.005)
    assert consumer.called.empty()
    for _ in range(2):  # again, if that did not help
        assert consumer.called.get(timeout=10) is reconnect
    with pytest.raises(OSError, match="reconnecting"):
        reconnect()
    dog.stop()
