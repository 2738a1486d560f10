"""The consumer: a Celery worker that calls a function for each message of its queues."""

from __future__ import annotations

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

from buildarena_pipeline.broker.queues import PROCESS_NEXT, Queues
from buildarena_pipeline.broker.watchdog import ConsumerWatchdog

FORKING_POOL = "prefork"
THREADS = "threads"


@dataclass(frozen=True, slots=True, kw_only=True)
class Callbacks:
    """What a consumer calls.

    Attributes:
        process_next: For each message, with its queue and job id.
        start: At the start of each process that works on messages.
        stop: At its end.
        stopping: Once, from a thread, when the process is asked to stop: what is being worked on
            should end soon.
        ready: Once, when messages are received.
    """

    process_next: Callable[[str, str], None]
    start: Callable[[], None]
    stop: Callable[[], None]
    stopping: Callable[[], None]
    ready: Callable[[], None]


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
    app.task(name=PROCESS_NEXT)(callbacks.process_next)
    watchdog = ConsumerWatchdog(queues, names)
    forks = pool == FORKING_POOL

    def ready(sender: Any, **_: Any) -> None:
        callbacks.ready()
        watchdog.start(sender)

    def start(**_: Any) -> None:
        callbacks.start()

    def stop(**_: Any) -> None:
        callbacks.stop()

    def stopping(**_: Any) -> None:
        # Celery calls this inside its signal handler, where no lock may be waited for.
        threading.Thread(target=callbacks.stopping, name="stopping", daemon=True).start()

    worker_ready.connect(ready, weak=False)
    worker_shutting_down.connect(stopping, weak=False)
    if forks:
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
        if not forks:
            callbacks.stop()
    return int(worker.exitcode or 0)
