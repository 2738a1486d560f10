"""Health checks of the service's backends, refreshed in the background.

A store that accepts connections and never answers blocks its callers. So each part is checked in
its own thread, and health and metrics answer from its last verdict.
"""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Callable
from typing import Any, Final, Generic, TypeVar

from anyio import to_thread

from buildarena_backend.artifacts.store import ArtifactStore
from buildarena_backend.process.context import Context
from buildarena_backend.states import CONSTRUCT_QUEUE
from buildarena_backend.telemetry.metrics import MetricValues
from buildarena_backend.workers import WorkerCounts

PATIENCE_S: Final = 3.0
"""Time after which a part counts as not answering."""
MOMENT_S: Final = 0.04
"""Wait of a request for a fresh verdict."""
OLD_S: Final = 30.0
"""Age at which a verdict is outdated: requests wait for another."""
ARTIFACTS_FRESH_S: Final = 5.0
"""Lifetime of the artifacts' verdict: a bucket charges for each request."""
FIGURES_FRESH_S: Final = 15.0
"""Several scrapes within this time share one reading of the service's figures."""

T = TypeVar("T")


class PartFailedError(Exception):
    """A part of the infrastructure does not work; the message is for people.

    Attributes:
        is_silent: Accepts requests, but does not answer.
    """

    def __init__(self, message: str, *, is_silent: bool = False) -> None:
        super().__init__(message)
        self.is_silent = is_silent


class Part(Generic[T]):
    """A part of the infrastructure, with one check at a time.

    Args:
        ask: Checks it; raises any exception if it does not work.
        fresh_s: A verdict of this age is given without asking again.

    Attributes:
        verdict: Result of the latest check, or why there is none.
    """

    def __init__(self, ask: Callable[[], T], *, fresh_s: float = 0.0) -> None:
        self._ask, self._fresh_s = ask, fresh_s
        self.asking: asyncio.Task[None] | None = None
        self._heard_at = -math.inf
        self.verdict: T | PartFailedError = PartFailedError("has not answered yet")

    async def renew(self) -> None:
        """Check the part, and wait a moment for the verdict; longer for the first one."""
        age_s = time.monotonic() - self._heard_at
        if self.asking is None and age_s >= self._fresh_s:
            self.asking = asyncio.create_task(self._ask_it())
        if self.asking is not None:
            await asyncio.wait([self.asking], timeout=MOMENT_S if age_s < OLD_S else PATIENCE_S)

    async def _ask_it(self) -> None:
        try:
            async with asyncio.timeout(PATIENCE_S):
                self.verdict = await to_thread.run_sync(self._ask, abandon_on_cancel=True)
        except TimeoutError:
            silence = f"has not answered for {PATIENCE_S:.0f} s"
            self.verdict = PartFailedError(silence, is_silent=True)
        except Exception as error:  # noqa: BLE001 - whatever is wrong is the verdict
            lines = str(error).strip().splitlines() or [type(error).__name__]
            self.verdict = PartFailedError(lines[0])
            self.verdict.__cause__ = error
        self._heard_at, self.asking = time.monotonic(), None


class Parts:
    """The parts of the service.

    Args:
        context: Connections that nothing else can exhaust.

    Attributes:
        database: Whether its schema fits; the register of workers.
        broker: Messages that wait for construct workers.
        artifacts: Whether artifacts can be written and read.
    """

    def __init__(self, context: Context) -> None:
        self._context = context
        settings = context.settings
        # With short time limits, which would be wrong for large artifacts.
        probed = ArtifactStore(
            settings.artifacts_location, settings.artifact_options, timeout_s=PATIENCE_S
        )
        self.database = Part(self._ask_database)
        self.broker = Part(self._ask_broker)
        self.artifacts = Part(probed.probe, fresh_s=ARTIFACTS_FRESH_S)
        self.figures: Part[MetricValues] = Part(context.store.metrics.read, fresh_s=FIGURES_FRESH_S)
        self._all: list[Part[Any]] = [self.database, self.broker, self.artifacts, self.figures]

    async def settle(self) -> None:
        """Wait a moment for running checks: they use connections."""
        if asking := [part.asking for part in self._all if part.asking is not None]:
            await asyncio.wait(asking, timeout=1.0)

    async def renew(self) -> None:
        """Wait a moment for fresh verdicts of all parts."""
        await asyncio.gather(*(part.renew() for part in self._all))

    def _ask_database(self) -> WorkerCounts:
        self._context.store.database.require_schema()
        return self._context.store.workers.counts()

    def _ask_broker(self) -> int:
        waiting = self._context.queues.waiting(CONSTRUCT_QUEUE)
        if waiting is None:
            raise PartFailedError("not reachable")
        return waiting
