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
from redis.backoff import NoBackoff
from redis.exceptions import RedisError
from redis.retry import Retry

from buildarena_backend.queue.announcer import Announcer
from buildarena_backend.queue.app import celery_app
from buildarena_backend.queue.breakers import CircuitBreaker

PROCESS_NEXT = "buildarena.process_next"
"""Name of the one message kind; its arguments are the queue's name and a job id."""
MAX_WAITING = 200
"""Messages kept waiting per queue; more are sent as workers take them."""
MAX_SENT = 1000
"""Messages sent at a time to a queue whose workers take them faster than anybody looks."""
TIMEOUT_S = 0.8
"""How long the broker may take for an answer: it has what it is asked for in memory."""
ENOUGH_WAITING = 50
"""Messages that are enough for a queue until the reaper runs again, a second later."""

log = structlog.get_logger(__name__)


class Queues:
    """Sends messages and counts those that wait.

    A broker that fails to answer is left alone until a probe in the background finds it well:
    nobody pays for its time-outs again and again.

    Args:
        broker_url: ``redis://…`` of a Redis or Valkey server.
    """

    def __init__(self, broker_url: str) -> None:
        self.app = celery_app(broker_url)
        self._broker_url = broker_url
        self._sender = self._new_sender()
        self._lock = threading.Lock()
        # Celery's queues are lists of the same name.
        self._redis = Redis.from_url(
            broker_url,
            socket_connect_timeout=TIMEOUT_S,
            socket_timeout=TIMEOUT_S,
            retry=Retry(NoBackoff(), 0),
        )
        self._breaker = CircuitBreaker(self._answers)
        self._announcer = Announcer(self.notify, most=MAX_SENT)
        self._topper = Announcer(self._top_up, most=ENOUGH_WAITING)

    def notify(self, queue: str, job_ids: Sequence[str]) -> bool:
        """Sends a queue's workers a message for each job, if the broker can be reached.

        Returns:
            False when the broker could not be reached; the reaper will try again.
        """
        if self._breaker.is_open:
            return False
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
            self._note_failure(queue, error)
            self._renew_sender(sender)
            return False
        return True

    def notify_one(self, queue: str, job_id: str) -> None:
        """Sends a message for one more job soon, unless enough wait for workers to come anyway.

        Any message makes a worker take whatever waits, and the reaper adds messages as they are
        taken; asking how many wait costs a tenth of sending one.
        """
        self._topper.announce(queue, [job_id])

    def announce(self, queue: str, job_ids: Sequence[str]) -> None:
        """As notify, but soon and in the background; returns at once."""
        self._announcer.announce(queue, job_ids)

    def settle(self) -> bool:
        """Waits until what was announced is sent or given up; returns whether that came to be."""
        return self._topper.wait() and self._announcer.wait()

    def _top_up(self, queue: str, job_ids: Sequence[str]) -> None:
        waiting = self.waiting(queue)
        if waiting is not None and waiting < ENOUGH_WAITING:
            self.notify(queue, job_ids[: ENOUGH_WAITING - waiting])

    def waiting(self, queue: str) -> int | None:
        """Messages that no worker has taken, or None when the broker can't be reached."""
        if self._breaker.is_open:
            return None
        try:
            return int(self._redis.llen(queue))
        except (RedisError, OSError) as error:
            self._note_failure(queue, error)
            return None

    def is_first(self, work: str, period_s: float) -> bool:
        """Whether no process has asked this within a period; also true where the broker is away.

        Args:
            work: What is to be done by one process in each period.
            period_s: How long the others are told no.
        """
        if self._breaker.is_open:
            return True
        try:
            return bool(self._redis.set(f"buildarena.{work}", 1, nx=True, px=int(1000 * period_s)))
        except (RedisError, OSError) as error:
            self._note_failure(work, error)
            return True

    def _note_failure(self, queue: str, error: Exception) -> None:
        log.warning("broker_unreachable", queue=queue, error=str(error))
        self._breaker.failed()

    def _answers(self) -> bool:
        try:
            return bool(self._redis.ping())
        except (RedisError, OSError):
            return False

    def _renew_sender(self, failed: Celery) -> None:
        """Takes a fresh sender: a pool's connections to a server that is gone stay in its way."""
        with self._lock:
            if self._sender is failed:
                self._sender = self._new_sender()

    def _new_sender(self) -> Celery:
        return celery_app(self._broker_url, timeout_s=TIMEOUT_S)

    def close(self) -> None:
        """Ends announcements and closes the connections to the broker."""
        self._announcer.close()
        self._topper.close()
        self._breaker.close()
        self._redis.close()
        self._sender.close()
        self.app.close()
