"""The Celery application of every process."""

from __future__ import annotations

from celery import Celery

from buildarena_backend.keepalive import tcp_options

TIMEOUT_S = 10.0
"""How long the broker may take for an answer."""


def celery_app(broker_url: str) -> Celery:
    """The Celery application of every process, without a result backend.

    Args:
        broker_url: ``redis://…``.
    """
    app = Celery("buildarena", broker=broker_url)
    app.conf.update(
        task_ignore_result=True,
        task_acks_late=False,
        task_create_missing_queues=True,
        worker_prefetch_multiplier=1,
        worker_hijack_root_logger=False,
        worker_send_task_events=False,
        worker_enable_remote_control=False,
        broker_connection_retry=True,
        broker_connection_retry_on_startup=True,
        broker_connection_max_retries=None,
        broker_transport_options={
            "socket_connect_timeout": 2.0,
            "socket_timeout": TIMEOUT_S,
            # A consumer waits for messages for hours, by no time-out.
            "socket_keepalive": True,
            "socket_keepalive_options": dict(tcp_options()),
            "max_retries": 1,
            "interval_start": 0,
            "interval_max": 0.2,
        },
    )
    return app
