"""Notifying workers of jobs that wait without a message."""

from __future__ import annotations

from typing import Protocol

from buildarena_pipeline.broker.queues import MAX_WAITING
from buildarena_pipeline.runtime.context import Context


class Notifier(Protocol):
    """The part of the queues that stage handlers use."""

    def notify_one(self, queue: str, job_id: str) -> None:
        """Sends a queue's workers a message for one more job, unless enough wait."""


def notify_waiting(context: Context, queue: str) -> None:
    """Keeps up to MAX_WAITING messages in a queue, for the jobs that no message names.

    The messages are sent in the background.
    """
    waiting = context.queues.waiting(queue)
    if waiting is None or waiting >= MAX_WAITING:
        return
    job_ids = context.store.leases.to_notify(queue, MAX_WAITING - waiting)
    if job_ids:
        context.queues.announce(queue, job_ids)
