"""Queues: Celery messages that only say "a job waits in this queue".

Postgres has the jobs; a message starts a worker, which then takes jobs until none is left.
Messages are acknowledged when they are received. Losing one costs seconds, because the reaper sends
others while jobs wait; so nothing rests on the broker's redelivery.
"""

from __future__ import annotations

from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from threading import Lock
from typing import Final

import structlog
from celery import Celery
from kombu.exceptions import OperationalError
from redis import Redis
from redis.backoff import NoBackoff
from redis.exceptions import RedisError
from redis.retry import Retry

from buildarena_backend.keepalive import tcp_options

PROCESS_NEXT: Final = "buildarena.process_next"
"""Name of the one message kind; its argument is the queue's name."""
MAX_WAITING: Final = 200
"""Messages kept waiting per queue."""
TIMEOUT_S: Final = 0.8
"""Timeout of the broker, which has all answers in memory."""

log = structlog.get_logger(__name__)


class Queues:
    """Sends messages, in the background, and counts those that wait.

    Args:
        broker_url: ``redis://…`` of a Redis or Valkey server.
    """

    def __init__(self, broker_url: str) -> None:
        self.app = celery_app(broker_url)
        # Celery's queues are lists of the same name.
        self._redis = Redis.from_url(
            broker_url,
            socket_connect_timeout=TIMEOUT_S,
            socket_timeout=TIMEOUT_S,
            retry=Retry(NoBackoff(), 0),
        )
        self._lock = Lock()
        self._wanted: Counter[str] = Counter()
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="waking")

    def wake(self, queue: str, messages: int = 1) -> None:
        """Make workers of a queue look for jobs soon, unless enough messages wait; never block."""
        with self._lock:
            is_scheduled = queue in self._wanted
            self._wanted[queue] += messages
            if not is_scheduled:
                self._thread.submit(self._send, queue)

    def settle(self) -> None:
        """Wait until all requested messages are sent or given up."""
        self._thread.submit(int).result()

    def waiting(self, queue: str) -> int | None:
        """Return the number of waiting messages, or None if the broker is unreachable."""
        try:
            return int(self._redis.llen(queue))
        except (RedisError, OSError) as error:
            log.warning("broker_unreachable", queue=queue, error=str(error))
            return None

    def _send(self, queue: str) -> None:
        with self._lock:
            number = self._wanted.pop(queue)
        waiting = self.waiting(queue)
        if waiting is None:
            return
        try:
            # A new connection: a pooled one may lead to a dead server.
            with self.app.connection_for_write() as connection:
                producer = self.app.amqp.Producer(connection)
                for _ in range(min(number, MAX_WAITING - waiting)):
                    self.app.send_task(
                        PROCESS_NEXT, args=(queue,), queue=queue, producer=producer, retry=False
                    )
        except (OperationalError, RedisError, OSError) as error:
            log.warning("broker_unreachable", queue=queue, error=str(error))

    def close(self) -> None:
        """Close the connections to the broker; unsent messages are left to the reaper."""
        self._thread.shutdown(cancel_futures=True)
        self._redis.close()
        self.app.close()


CELERY_TIMEOUT_S: Final = 10.0
"""Timeout of the broker for Celery."""


def celery_app(broker_url: str) -> Celery:
    """Return the Celery application of every process, without a result backend.

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
            "socket_timeout": CELERY_TIMEOUT_S,
            # A consumer waits for messages for hours, by no time-out.
            "socket_keepalive": True,
            "socket_keepalive_options": dict(tcp_options()),
            "max_retries": 1,
            "interval_start": 0,
            "interval_max": 0.2,
        },
    )
    return app
