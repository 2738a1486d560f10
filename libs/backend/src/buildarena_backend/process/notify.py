"""Notifying workers of jobs that wait without a message."""

from __future__ import annotations

from typing import Protocol

from buildarena_backend.process.context import Context
from buildarena_backend.queue.queues import MAX_WAITING


class Notifier(Protocol):
    """The part of the queues that stage handlers use."""

    def notify_one(self, queue: str, job_id: str) -> None:
        """Sends a queue's workers a message for one more job, unless enough wait."""


def notify_waiting(context: Context, queue: str, *, most: int = MAX_WAITING) -> int | None:
    """Keeps messages in a queue, for the jobs that no message names.

    The messages are sent in the background.

    Args:
        context: The process' connections.
        queue: The queue's name.
        most: Messages that wait then, if so many jobs do.

    Returns:
        The messages that waited before; None when the broker can't be reached.
    """
    waiting = context.queues.waiting(queue)
    if waiting is None or waiting >= most:
        return waiting
    job_ids = context.store.waiting.to_notify(queue, most - waiting)
    if job_ids:
        context.queues.announce(queue, job_ids)
    return waiting
