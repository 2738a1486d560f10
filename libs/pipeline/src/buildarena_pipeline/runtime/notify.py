"""Notifying workers of jobs that wait without a message."""

from __future__ import annotations

from buildarena_pipeline.broker.queues import MAX_WAITING
from buildarena_pipeline.runtime.context import Context


def notify_waiting(context: Context, queue: str) -> None:
    """Keeps up to MAX_WAITING messages in a queue, for the jobs that no message names."""
    waiting = context.queues.waiting(queue)
    if waiting is None or waiting >= MAX_WAITING:
        return
    job_ids = context.store.leases.to_notify(queue, MAX_WAITING - waiting)
    if job_ids:
        context.queues.notify(queue, job_ids)
