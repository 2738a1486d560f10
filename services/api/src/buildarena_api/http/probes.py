"""What the service stands on, asked in the background: whoever asks how it is never waits for it.

A store that accepts connections and says nothing holds up whoever asks it. So each part is asked by
a thread of its own, and health and metrics answer from its last verdict.
"""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import Any, Final, Generic, TypeVar

from buildarena_api.http.own_pool import OwnPool
from buildarena_backend.artifacts.storing import ArtifactStore
from buildarena_backend.process.context import Context
from buildarena_backend.states import CONSTRUCT_QUEUE
from buildarena_backend.workers import WorkerCounts

PATIENCE_S: Final = 3.0
"""How long a part may take before it counts as not answering."""
MOMENT_S: Final = 0.04
"""How long somebody who asks waits for a fresh verdict."""
UNASKED_EVERY_S: Final = 10.0
"""How often a part is asked while nobody wants to know."""
ARTIFACTS_FRESH_S: Final = 5.0
"""A bucket takes money for each question."""
VALUES_FRESH_S: Final = 15.0
"""Several scrapes within this time share one reading of the service's figures."""

PROBERS: Final = 2
"""Parts that ask the database."""

T_co = TypeVar("T_co", covariant=True)


class PartFailedError(Exception):
    """A part of the infrastructure does not work; the message is for people.

    Attributes:
        is_silent: It takes what it is sent, and does not answer.
    """

    def __init__(self, message: str, *, is_silent: bool = False) -> None:
        super().__init__(message)
        self.is_silent = is_silent


class Probe(Generic[T_co]):
    """Asks one part, again and again, in a thread.

    Args:
        name: Of the part, as health names it.
        ask: Asks it; any exception says that it does not work.
        fresh_s: A verdict of this age is given without asking again.
        every_s: How often it is asked while nobody wants to know; None for never.
        clock: Seconds of a clock that only goes forward.
    """

    def __init__(
        self,
        name: str,
        ask: Callable[[], T_co],
        *,
        fresh_s: float = 0.0,
        every_s: float | None = UNASKED_EVERY_S,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.name = name
        self._ask = ask
        self._fresh_s, self._every_s, self._clock = fresh_s, every_s, clock
        self._lock = threading.Lock()
        self._wanted = threading.Event()
        self._is_ending = False
        self._next: Future[None] = Future()
        self._begun_at: float | None = None
        self._ended_at: float | None = None
        self._verdict: T_co | Exception | None = None
        self._thread = threading.Thread(target=self._run, name=f"probe {name}", daemon=True)

    def start(self) -> None:
        """Begins to ask."""
        if self._every_s is not None:
            self._wanted.set()
        self._thread.start()

    def end(self) -> None:
        """Asks no more; a question that is open is left to itself."""
        self._is_ending = True
        self._wanted.set()

    def join(self, timeout_s: float) -> None:
        """Waits for an open question to end."""
        self._thread.join(timeout_s)

    def latest(self) -> T_co:
        """What the part last said, at once.

        Raises:
            PartFailedError: It does not work, does not answer, or was not asked yet.
        """
        with self._lock:
            verdict, begun_at = self._verdict, self._begun_at
        waited_s = 0.0 if begun_at is None else self._clock() - begun_at
        if waited_s > PATIENCE_S:
            raise PartFailedError(f"has not answered for {waited_s:.0f} s", is_silent=True)
        if isinstance(verdict, Exception):
            lines = str(verdict).strip().splitlines() or [type(verdict).__name__]
            raise PartFailedError(lines[0]) from verdict
        if verdict is None:
            raise PartFailedError("has not answered yet")
        return verdict

    @property
    def works(self) -> bool:
        """Whether the last answer was a good one."""
        try:
            self.latest()
        except PartFailedError:
            return False
        return True

    def renewed(self) -> Future[None] | None:
        """Has the part asked, and tells when it answered; None if no answer is to be waited for."""
        with self._lock:
            now = self._clock()
            if self._ended_at is not None and now - self._ended_at < self._fresh_s:
                return None
            self._wanted.set()
            if self._begun_at is not None and now - self._begun_at > MOMENT_S:
                return None if self._verdict is not None else self._next
            return self._next

    @property
    def is_known(self) -> bool:
        """Whether there is any verdict."""
        with self._lock:
            return self._verdict is not None

    def _run(self) -> None:
        while True:
            self._wanted.wait(self._every_s)
            with self._lock:
                if self._is_ending:
                    return
                self._wanted.clear()
                answered, self._next = self._next, Future()
                self._begun_at = self._clock()
            verdict: T_co | Exception
            try:
                verdict = self._ask()
            except Exception as error:  # noqa: BLE001 - whatever is wrong is the verdict
                verdict = error
            with self._lock:
                self._verdict = verdict
                self._begun_at, self._ended_at = None, self._clock()
            answered.set_result(None)


class Probes:
    """The parts of the service.

    Args:
        context: The process' connections.

    Attributes:
        database: Whether its schema fits; the register of workers.
        broker: Messages that wait for construct workers.
        artifacts: Whether artifacts can be written and read.
        values: The service's figures.
    """

    def __init__(self, context: Context) -> None:
        settings = context.settings
        self._pool = OwnPool(context, size=PROBERS, name="probing")
        self._context = self._pool.context
        # With short time limits, which would be wrong for large artifacts.
        self._artifacts = ArtifactStore(
            settings.artifacts_location, settings.artifact_options, timeout_s=PATIENCE_S
        )
        self.database = Probe("database", self._ask_database)
        self.broker = Probe("broker", self._ask_broker)
        self.artifacts = Probe("artifacts", self._ask_artifacts, fresh_s=ARTIFACTS_FRESH_S)
        self.values = Probe(
            "figures", self._context.store.metrics.read, fresh_s=VALUES_FRESH_S, every_s=None
        )

    @property
    def _all(self) -> Sequence[Probe[Any]]:
        return self.database, self.broker, self.artifacts, self.values

    def start(self) -> None:
        """Begins to ask all parts."""
        for probe in self._all:
            probe.start()

    def close(self) -> None:
        """Ends, without waiting for a part that does not answer."""
        for probe in self._all:
            probe.end()
        ends_at = time.monotonic() + PATIENCE_S
        for probe in self._all:
            probe.join(max(0.0, ends_at - time.monotonic()))
        self._pool.close()

    async def renew(self, *probes: Probe[Any]) -> None:
        """Gives parts a moment for a fresh answer, those never heard of all of their time."""
        asked = [(probe, probe.renewed()) for probe in probes]
        answers = [
            (asyncio.wrap_future(answer), MOMENT_S if probe.is_known else PATIENCE_S)
            for probe, answer in asked
            if answer is not None
        ]
        for moment_s in sorted({moment_s for _, moment_s in answers}):
            await asyncio.wait([each for each, its in answers if its == moment_s], timeout=moment_s)

    def _ask_database(self) -> WorkerCounts:
        self._context.store.database.require_schema()
        return self._context.store.workers.counts()

    def _ask_broker(self) -> int:
        waiting = self._context.queues.waiting(CONSTRUCT_QUEUE)
        if waiting is None:
            raise PartFailedError("not reachable")
        return waiting

    def _ask_artifacts(self) -> bool:
        self._artifacts.probe()
        return True
