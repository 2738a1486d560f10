"""Whether a worker still hears its messages.

A broker that dies again while Celery reconnects to it can leave the consumer waiting on a socket
that is gone, for ever: messages wait, the worker is idle, and nothing is an error. A worker that is
idle for seconds while messages wait for it therefore takes a new connection.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import structlog
from celery.signals import task_received
from celery.worker import state

from buildarena_pipeline.broker.queues import Queues
from buildarena_pipeline.runtime.periodic import Periodic

log = structlog.get_logger(__name__)

PERIOD_S = 1.0
DEAF_AFTER_S = 5.0
"""A worker that hears takes a message within milliseconds."""


class Consumer(Protocol):
    """The part of Celery's consumer that is used here."""

    def call_soon(self, callback: Callable[[], None]) -> Any:
        """Calls back from the consumer's loop."""


class Hearing:
    """Watches a worker's consumer from a thread.

    Args:
        queues: The broker.
        names: The queues that the worker serves.
        period_s: Seconds between looks.
        deaf_after_s: How long messages may wait for an idle worker.
    """

    def __init__(
        self,
        queues: Queues,
        names: Sequence[str],
        *,
        period_s: float = PERIOD_S,
        deaf_after_s: float = DEAF_AFTER_S,
    ) -> None:
        self._queues = queues
        self._names = names
        self._period_s = period_s
        self._deaf_after_s = deaf_after_s
        self._consumer: Consumer | None = None
        self._received = False
        self._deaf_s = 0.0
        self._thread = Periodic(self._look, name="hearing", period_s=period_s)

    def start(self, consumer: Consumer) -> None:
        """Starts to watch."""
        self._consumer = consumer
        task_received.connect(self._hear, weak=False)
        self._thread.start()

    def stop(self) -> None:
        """Stops to watch."""
        task_received.disconnect(self._hear)
        self._thread.stop()

    def _hear(self, **_: Any) -> None:
        self._received = True

    def _look(self) -> None:
        quiet = not self._received and not state.reserved_requests
        self._received = False
        if not quiet or not any(self._queues.waiting(name) for name in self._names):
            self._deaf_s = 0.0
            return
        self._deaf_s += self._period_s
        if self._deaf_s >= self._deaf_after_s and self._consumer is not None:
            log.warning("deaf_to_messages", queues=list(self._names))
            self._consumer.call_soon(reconnect)
            self._deaf_s = 0.0


def reconnect() -> None:
    """Makes the consumer, from whose loop it is called, take a new connection.

    Raises:
        ConnectionResetError: Always; it is what Celery meets with a reconnection.
    """
    raise ConnectionResetError("no message came while some wait: the connection is taken anew")
