from __future__ import annotations

import queue
import time
from collections.abc import Iterator
from typing import Any

import pytest
from celery.signals import task_received

from buildarena_pipeline.broker.watchdog import ConsumerWatchdog, reconnect

SOON_S = 10


class Consumer:
    """Keeps what it is to call."""

    def __init__(self) -> None:
        self.called: queue.Queue[Any] = queue.Queue()

    def call_soon(self, callback: Any) -> None:
        self.called.put(callback)


@pytest.fixture
def consumer(context) -> Iterator[Consumer]:
    watched = Consumer()
    watchdog = ConsumerWatchdog(context.queues, ["simulate.x"], period_s=0.02, stalled_after_s=0.1)
    watchdog.start(watched)
    yield watched
    watchdog.stop()


def test_an_idle_worker_takes_a_new_connection_when_messages_wait(context, consumer) -> None:
    context.queues.notify("simulate.x", ["job_1"])
    assert consumer.called.get(timeout=SOON_S) is reconnect
    with pytest.raises(OSError, match="reconnecting"):
        reconnect()
    assert consumer.called.get(timeout=SOON_S) is reconnect  # again, if that did not help


def test_a_worker_without_messages_keeps_its_connection(consumer) -> None:
    with pytest.raises(queue.Empty):
        consumer.called.get(timeout=0.5)


def test_a_worker_that_receives_messages_keeps_its_connection(context, consumer) -> None:
    context.queues.notify("simulate.x", ["job_1"])
    ends = time.monotonic() + 0.5
    while time.monotonic() < ends:
        task_received.send(sender=None)
        time.sleep(0.005)
    assert consumer.called.empty()
