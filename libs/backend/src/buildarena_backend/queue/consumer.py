"""The consumer: a Celery worker that calls a function for each message of its queues."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import structlog
from celery.signals import (
    task_received,
    worker_process_init,
    worker_process_shutdown,
    worker_ready,
    worker_shutting_down,
)
from celery.worker import state

from buildarena_backend.periodic import Periodic
from buildarena_backend.queue.queues import PROCESS_NEXT, Queues

log = structlog.get_logger(__name__)

PERIOD_S = 2.0
STALLED_AFTER_S = 5.0
"""A consumer that works takes a message within milliseconds."""


class Consumer(Protocol):
    """The part of Celery's consumer that is used here."""

    def call_soon(self, callback: Callable[[], None]) -> Any:
        """Call back from the consumer's loop."""


class ConsumerWatchdog:
    """Watches a worker's consumer from a thread.

    Args:
        names: The queues that the worker serves.
        period_s: Seconds between checks.
        stalled_after_s: Time that messages may wait for an idle worker.
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
        """Start watching."""
        self._consumer = consumer
        task_received.connect(self._receive, weak=False)
        self._thread.start()

    def stop(self) -> None:
        """Stop watching."""
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
    """Make the consumer, from whose loop it is called, take a new connection.

    Raises:
        ConnectionResetError: Always; it is what Celery meets with a reconnection.
    """
    raise ConnectionResetError("no message was received while some wait: reconnecting")


FORKING_POOL = "prefork"
THREADS = "threads"


@dataclass(frozen=True, slots=True, kw_only=True)
class Callbacks:
    """Callbacks of a consumer.

    Attributes:
        process: For each message, with its queue.
        start: At the start of each process that works on messages.
        stop: At its end.
        stopping: Once in each process that works on messages, from a thread, when the consumer is
            asked to stop: what is being worked on should end soon.
        ready: Once, when messages are received.
    """

    process: Callable[[str], None]
    start: Callable[[], None]
    stop: Callable[[], None]
    stopping: Callable[[], None]
    ready: Callable[[], None]


class _Children:
    """Tells the children of a forking pool, which hear of no signal, that the worker stops.

    They read from a pipe until their parent, the only one who could write, closes it.
    """

    def __init__(self) -> None:
        self._reads, self._writes = os.pipe()

    def listen(self, callback: Callable[[], None]) -> None:
        """Have something called, in a child, when the worker stops."""
        os.close(self._writes)

        def wait() -> None:
            os.read(self._reads, 1)
            callback()

        threading.Thread(target=wait, name="stopping", daemon=True).start()

    def stop(self) -> None:
        """Tell all children, and those that are forked yet."""
        os.close(self._writes)


def consume(
    queues: Queues, names: Sequence[str], *, pool: str, concurrency: int, callbacks: Callbacks
) -> int:
    """Serve queues until the process is asked to stop.

    Args:
        pool: Celery pool: ``threads``, ``prefork`` or ``solo``.
        concurrency: Messages at once.
        callbacks: `start` and `stop` run in each child of a forking pool.

    Returns:
        The process' exit code.
    """
    app = queues.app
    app.task(name=PROCESS_NEXT)(callbacks.process)
    watchdog = ConsumerWatchdog(queues, names)
    children = _Children() if pool == FORKING_POOL else None

    def ready(sender: Any, **_: Any) -> None:
        callbacks.ready()
        watchdog.start(sender)

    def start(**_: Any) -> None:
        callbacks.start()
        if children is not None:
            children.listen(callbacks.stopping)

    def stop(**_: Any) -> None:
        callbacks.stop()

    def stopping(**_: Any) -> None:
        if children is not None:
            children.stop()
            return
        # Celery calls this inside its signal handler, where no lock may be waited for.
        threading.Thread(target=callbacks.stopping, name="stopping", daemon=True).start()

    worker_ready.connect(ready, weak=False)
    worker_shutting_down.connect(stopping, weak=False)
    if children is not None:
        worker_process_init.connect(start, weak=False)
        worker_process_shutdown.connect(stop, weak=False)
    else:
        callbacks.start()
    worker = app.Worker(
        queues=list(names),
        pool=pool,
        concurrency=concurrency,
        without_gossip=True,
        without_mingle=True,
        without_heartbeat=True,
        loglevel="WARNING",
        quiet=True,
    )
    try:
        worker.start()
    finally:
        watchdog.stop()
        if children is None:
            callbacks.stop()
    return int(worker.exitcode or 0)
