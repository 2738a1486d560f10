"""The consumer: a Celery worker that calls a function for each message of its queues."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from celery.signals import (
    worker_process_init,
    worker_process_shutdown,
    worker_ready,
    worker_shutting_down,
)

from buildarena_backend.queue.queues import PROCESS_NEXT, Queues
from buildarena_backend.queue.watchdog import ConsumerWatchdog

FORKING_POOL = "prefork"
THREADS = "threads"


@dataclass(frozen=True, slots=True, kw_only=True)
class Callbacks:
    """What a consumer calls.

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
        """Has something called, in a child, when the worker stops."""
        os.close(self._writes)

        def wait() -> None:
            os.read(self._reads, 1)
            callback()

        threading.Thread(target=wait, name="stopping", daemon=True).start()

    def stop(self) -> None:
        """Tells all children, and those that are forked yet."""
        os.close(self._writes)


def consume(
    queues: Queues, names: Sequence[str], *, pool: str, concurrency: int, callbacks: Callbacks
) -> int:
    """Serves queues until the process is asked to stop.

    Args:
        queues: The broker.
        names: The queues to serve.
        pool: Celery pool: ``threads``, ``prefork`` or ``solo``.
        concurrency: Messages at once.
        callbacks: What is called; `start` and `stop` run in each child of a forking pool.

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
