"""The Celery application of every process."""

from __future__ import annotations

from typing import Any

from celery import Celery
from celery.app.amqp import AMQP
from kombu.connection import Connection
from kombu.transport.redis import Transport

from buildarena_backend.keepalive import tcp_options

LONGEST_PAUSE_S = 5
"""Between two tries to reach a broker that is away."""


class _Connection(Connection):
    """Tries again soon: Celery's pauses, which no setting changes, grow to half a minute."""

    def ensure_connection(self, *args: Any, **options: Any) -> Any:
        """Connects, however long it takes."""
        pauses = {"interval_start": 1, "interval_step": 1, "interval_max": LONGEST_PAUSE_S}
        return super().ensure_connection(*args, **{**pauses, **options})  # type: ignore[no-untyped-call]


class _Transport(Transport):
    """Waits longer for a message before it asks again: a worker without jobs does little else."""

    brpop_timeout = 5


class _Amqp(AMQP):  # type: ignore[misc]
    Connection = _Connection


def celery_app(broker_url: str, *, timeout_s: float = 10.0) -> Celery:
    """The Celery application of every process, without a result backend.

    Args:
        broker_url: ``redis://…``.
        timeout_s: How long the broker may take for an answer.
    """
    app = Celery("buildarena", broker=broker_url, amqp=_Amqp)
    app.conf.update(
        task_ignore_result=True,
        task_acks_late=False,
        task_create_missing_queues=True,
        worker_prefetch_multiplier=1,
        worker_hijack_root_logger=False,
        worker_send_task_events=False,
        worker_enable_remote_control=False,
        broker_transport=f"{__name__}:{_Transport.__name__}",
        broker_connection_retry=True,
        broker_connection_retry_on_startup=True,
        broker_connection_max_retries=None,
        broker_transport_options={
            "socket_connect_timeout": min(2.0, timeout_s),
            "socket_timeout": timeout_s,
            # A consumer waits for messages for hours, by no time-out.
            "socket_keepalive": True,
            "socket_keepalive_options": dict(tcp_options()),
            "max_retries": 1,
            "interval_start": 0,
            "interval_max": 0.2,
        },
    )
    return app
