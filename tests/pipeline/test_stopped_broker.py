"""A broker that was stopped, not killed, slows nobody."""

from __future__ import annotations

import asyncio
import os
import signal
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager

import httpx
import pytest
from support.servers.live_api import live_api
from support.servers.stacks import wait_until

from buildarena_api.http import overload
from buildarena_cli.local import EmbeddedValkey
from buildarena_pipeline.broker.announcer import Announcer
from buildarena_pipeline.broker.queues import TIMEOUT_S, Queues
from buildarena_pipeline.runtime.context import open_context
from buildarena_worker.providers.throttle import Throttle

QUICK_S = 1.0
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
    os.kill(pid, signal.SIGSTOP)
    try:
        yield
    finally:
        os.kill(pid, signal.SIGCONT)


@pytest.mark.ci
def test_requests_stay_quick_and_jobs_flow_again(context, valkey, monkeypatch) -> None:
    # Refusals are held back by up to a second on purpose, which is not what is measured here.
    monkeypatch.setattr(overload, "HELD_S", (0.0, 0.0))
    url, pid = valkey
    changes = {"broker_url": url, "rate_limit": "25/minute"}
    own = open_context(context.settings.model_copy(update=changes))
    with closing(own), live_api(own) as api, httpx.Client(base_url=api, timeout=30) as client:
        assert client.post("/v1/jobs", json=JOB).status_code == 202
        with stopped(pid):
            # The first to meet it pay one short time-out each: counting and announcing.
            client.post("/v1/jobs", json={**JOB, "seed": 1})
            times, answers = [], []
            for number in range(40):
                started = time.monotonic()
                job = {**JOB, "seed": 2 + number}
                answers.append(client.post("/v1/jobs", json=job).status_code)
                times.append(time.monotonic() - started)
            started = time.monotonic()
            checks = client.get("/v1/health").json()["checks"]
            times.append(time.monotonic() - started)
            assert max(times) < QUICK_S
            # This process counts alone meanwhile.
            assert set(answers) == {202, 429}
            broker = next(check for check in checks if check["name"] == "broker")
            assert (broker["ok"], "not reachable" in broker["detail"]) == (False, True)
        wait_until(lambda: (own.queues.waiting("construct") or 0) > 20, 20, "jobs flow again")


@pytest.mark.ci
def test_every_stop_costs_a_message_one_short_time_out(valkey) -> None:
    url, pid = valkey
    queues, times = Queues(url), []
    try:
        for _ in range(2):
            wait_until(lambda: queues.notify("construct", ["job_1"]), 10, "messages are sent")
            with stopped(pid):
                started = time.monotonic()
                assert not queues.notify("construct", ["job_2"])
                times.append(time.monotonic() - started)
    finally:
        queues.close()
    assert max(times) < 4 * TIMEOUT_S, times


@pytest.mark.ci
def test_provider_requests_go_on_without_waiting_each(context, valkey) -> None:
    url, pid = valkey

    async def main() -> tuple[float, list[float], bool]:
        throttle = Throttle(url, "p")
        async with throttle.slot() as slot:
            slot.succeeded()
        times = []
        with stopped(pid):
            started = time.monotonic()
            async with throttle.slot():
                first = time.monotonic() - started
            for _ in range(20):
                started = time.monotonic()
                async with throttle.slot() as slot:
                    slot.succeeded()
                times.append(time.monotonic() - started)
        back = False
        for _ in range(100):
            await asyncio.sleep(0.1)
            try:
                back = await throttle.limit() >= 1
                break
            except (ConnectionError, OSError):
                continue
        await throttle.close()
        return first, times, back

    first, times, back = asyncio.run(main())
    assert first < 5
    assert max(times) < QUICK_S
    assert back
    del context


def test_announcements_are_merged_and_bounded() -> None:
    sent: list[tuple[str, list[str]]] = []
    announcer = Announcer(lambda queue, ids: sent.append((queue, list(ids))), most=3)
    with announcer._changed:
        announcer.announce("a", ["1", "2"])
        announcer.announce("a", ["2", "3", "4", "5"])
        announcer.announce("b", ["9"])
    assert announcer.wait()
    announcer.close()
    assert [queue for queue, _ in sent] == ["a", "b"]
    assert len(sent[0][1]) <= 3
    assert sent[0][1][:2] == ["1", "2"]


def test_an_announcement_that_fails_does_not_end_the_others() -> None:
    sent = []

    def send(queue: str, ids: list[str]) -> None:
        if queue == "bad":
            raise RuntimeError("no")
        sent.extend(ids)

    announcer = Announcer(send, most=3)
    announcer.announce("bad", ["1"])
    announcer.announce("good", ["2"])
    assert announcer.wait()
    announcer.close()
    assert sent == ["2"]
