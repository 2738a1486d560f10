"""The consumer watchdog: whether a worker still receives its messages.

A broker that dies again while Celery reconnects to it can leave the consumer waiting on a socket
that is gone, forever: messages wait, the worker is idle, and nothing is an error. A worker that is
idle for seconds while messages wait for it therefore takes a new connection.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import structlog
from celery.signals import task_received
from celery.worker import state

from buildarena_backend.periodic import Periodic
from buildarena_backend.queue.queues import Queues

log = structlog.get_logger(__name__)

PERIOD_S = 2.0
STALLED_AFTER_S = 5.0
"""A consumer that works takes a message within milliseconds."""


class Consumer(Protocol):
    """The part of Celery's consumer that is used here."""

    def call_soon(self, callback: Callable[[], None]) -> Any:
        """Calls back from the consumer's loop."""


class ConsumerWatchdog:
    """Watches a worker's consumer from a thread.

    Args:
        queues: The broker.
        names: The queues that the worker serves.
        period_s: Seconds between checks.
        stalled_after_s: How long messages may wait for an idle worker.
    """

    def __init__(
        self,
        queues: Queues,
        names: Sequence[str],
        *,
        period_s: float = PERIOD_S,
        stalled_after_s: float = STALLED_AFTER_S,
    ) -> None:
        self._queues = queues
        self._names = names
        self._period_s = period_s
        self._stalled_after_s = stalled_after_s
        self._consumer: Consumer | None = None
        self._received = False
        self._stalled_s = 0.0
        self._thread = Periodic(self._check, name="watchdog", period_s=period_s)

    def start(self, consumer: Consumer) -> None:
        """Starts watching."""
        self._consumer = consumer
        task_received.connect(self._receive, weak=False)
        self._thread.start()

    def stop(self) -> None:
        """Stops watching."""
        task_received.disconnect(self._receive)
        self._thread.stop()

    def _receive(self, **_: Any) -> None:
        self._received = True

    def _check(self) -> None:
        quiet = not self._received and not state.reserved_requests
        self._received = False
        if not quiet or not any(self._queues.waiting(name) for name in self._names):
            self._stalled_s = 0.0
            return
        self._stalled_s += self._period_s
        if self._stalled_s >= self._stalled_after_s and self._consumer is not None:
            log.warning("consumer_stalled", queues=list(self._names))
            self._consumer.call_soon(reconnect)
            self._stalled_s = 0.0


def reconnect() -> None:
    """Makes the consumer, from whose loop it is called, take a new connection.

    Raises:
        ConnectionResetError: Always; it is what Celery meets with a reconnection.
    """
    raise ConnectionResetError("no message was received while some wait: reconnecting")
