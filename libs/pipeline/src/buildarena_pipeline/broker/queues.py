"""Queues: Celery messages that only say "look at this job".

Messages are acknowledged when they are received. Losing one costs seconds, because the sweeper
announces waiting jobs again; so nothing rests on the broker's redelivery.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence

import structlog
from celery import Celery
from kombu.exceptions import OperationalError
from redis import Redis
from redis.exceptions import RedisError

LOOK = "buildarena.look"
"""Name of the one message kind; its arguments are the queue's name and a job id."""

CONSTRUCT = "construct"
VERIFY = "verify"
EXTERNAL = "external"
"""Where jobs of outside agents are while they build: no worker serves it."""
BATCH = 200
"""Messages kept waiting per queue; more are sent as workers take them."""
PLENTY = 50
"""Messages that are enough for a queue until the sweeper looks again, a second later."""

log = structlog.get_logger(__name__)


def simulate_queue(engine: str) -> str:
    """The queue of a simulator."""
    return f"simulate.{engine}"


def celery_app(broker_url: str) -> Celery:
    """The Celery application of every process, without a result backend."""
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
            "socket_connect_timeout": 2,
            "socket_timeout": 10,
            "max_retries": 1,
            "interval_start": 0,
            "interval_max": 0.2,
        },
    )
    return app


class Queues:
    """Sends messages and counts those that wait.

    Args:
        broker_url: ``redis://…`` of a Redis or Valkey server.
    """

    def __init__(self, broker_url: str) -> None:
        self.app = celery_app(broker_url)
        self._sender = celery_app(broker_url)
        self._broker_url = broker_url
        self._guard = threading.Lock()
        # Celery's queues are lists of the same name.
        self._redis = Redis.from_url(broker_url, socket_connect_timeout=2, socket_timeout=10)

    def announce(self, queue: str, job_ids: Sequence[str]) -> bool:
        """Tells a queue's workers of jobs, as well as it can.

        Returns:
            False when the broker could not be reached; the sweeper will try again.
        """
        sender = self._sender
        try:
            with sender.producer_pool.acquire(block=True) as producer:
                for job_id in job_ids:
                    sender.send_task(
                        LOOK, args=(queue, job_id), queue=queue, producer=producer, retry=False
                    )
        except (OperationalError, RedisError, OSError) as error:
            log.warning("broker_unreachable", queue=queue, error=str(error))
            self._renew_sender(sender)
            return False
        return True

    def nudge(self, queue: str, job_id: str) -> None:
        """Tells of one more job, unless so many messages wait that workers will come anyway.

        Any message makes a worker take whatever waits, and the sweeper adds messages as they are
        taken; asking how many wait costs a tenth of sending one.
        """
        waiting = self.waiting(queue)
        if waiting is not None and waiting < PLENTY:
            self.announce(queue, [job_id])

    def waiting(self, queue: str) -> int | None:
        """Messages that no worker has taken, or None when the broker can't be reached."""
        try:
            return int(self._redis.llen(queue))
        except (RedisError, OSError) as error:
            log.warning("broker_unreachable", queue=queue, error=str(error))
            return None

    def _renew_sender(self, failed: Celery) -> None:
        """Takes a fresh sender: a pool's connections to a server that is gone stay in its way."""
        with self._guard:
            if self._sender is failed:
                self._sender = celery_app(self._broker_url)

    def close(self) -> None:
        """Closes the connections to the broker."""
        self._redis.close()
        self._sender.close()
        self.app.close()
