"""Queues: Celery messages that only say "process your queue's next job, this one if you can".

Messages are acknowledged when they are received. Losing one costs seconds, because the reaper
notifies workers of waiting jobs again; so nothing rests on the broker's redelivery.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence

import structlog
from celery import Celery
from kombu.exceptions import OperationalError
from redis import Redis
from redis.exceptions import RedisError

from buildarena_pipeline.broker.app import celery_app

PROCESS_NEXT = "buildarena.process_next"
"""Name of the one message kind; its arguments are the queue's name and a job id."""
MAX_WAITING = 200
"""Messages kept waiting per queue; more are sent as workers take them."""
ENOUGH_WAITING = 50
"""Messages that are enough for a queue until the reaper runs again, a second later."""

log = structlog.get_logger(__name__)


class Queues:
    """Sends messages and counts those that wait.

    Args:
        broker_url: ``redis://…`` of a Redis or Valkey server.
    """

    def __init__(self, broker_url: str) -> None:
        self.app = celery_app(broker_url)
        self._sender = celery_app(broker_url)
        self._broker_url = broker_url
        self._lock = threading.Lock()
        # Celery's queues are lists of the same name.
        self._redis = Redis.from_url(broker_url, socket_connect_timeout=2, socket_timeout=10)

    def notify(self, queue: str, job_ids: Sequence[str]) -> bool:
        """Sends a queue's workers a message for each job, if the broker can be reached.

        Returns:
            False when the broker could not be reached; the reaper will try again.
        """
        sender = self._sender
        try:
            with sender.producer_pool.acquire(block=True) as producer:
                for job_id in job_ids:
                    sender.send_task(
                        PROCESS_NEXT,
                        args=(queue, job_id),
                        queue=queue,
                        producer=producer,
                        retry=False,
                    )
        except (OperationalError, RedisError, OSError) as error:
            log.warning("broker_unreachable", queue=queue, error=str(error))
            self._renew_sender(sender)
            return False
        return True

    def notify_one(self, queue: str, job_id: str) -> None:
        """Sends a message for one more job, unless so many wait that workers will come anyway.

        Any message makes a worker take whatever waits, and the reaper adds messages as they are
        taken; asking how many wait costs a tenth of sending one.
        """
        waiting = self.waiting(queue)
        if waiting is not None and waiting < ENOUGH_WAITING:
            self.notify(queue, [job_id])

    def waiting(self, queue: str) -> int | None:
        """Messages that no worker has taken, or None when the broker can't be reached."""
        try:
            return int(self._redis.llen(queue))
        except (RedisError, OSError) as error:
            log.warning("broker_unreachable", queue=queue, error=str(error))
            return None

    def _renew_sender(self, failed: Celery) -> None:
        """Takes a fresh sender: a pool's connections to a server that is gone stay in its way."""
        with self._lock:
            if self._sender is failed:
                self._sender = celery_app(self._broker_url)

    def close(self) -> None:
        """Closes the connections to the broker."""
        self._redis.close()
        self._sender.close()
        self.app.close()
