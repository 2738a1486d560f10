"""Concurrency limits per caller and in total.

Decided in the event loop, before a request takes a thread or a database connection.
"""

from __future__ import annotations

import asyncio
import math
import random
from collections import Counter
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import AsyncExitStack, asynccontextmanager
from typing import Final, Literal
from weakref import WeakValueDictionary

from anyio import CapacityLimiter
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from buildarena_api.http.problems import ErrorCode, ProblemError

WAIT_S: Final = 30.0
"""Wait of a request for its turn."""
MAX_OPEN: Final = 96
"""Requests of one caller that are open at once: its streams, and as many ordinary ones again
as can wait for their turn."""
HELD_S: Final = (0.5, 1.0)
"""Delay of a refusal: a caller that retries at once would be refused thousands of times in a
second. Random, or the callers retry together."""
HEALTH_PATH: Final = "/v1/health"

Kind = Literal[
    "ordinary",
    "heavy",
    "files",
    "bodies",
    "streams",
    "trajectories",
    "runner_waits",
    "runner_outcomes",
    "uploads",
]


class Places:
    """Places for one kind of work.

    A caller's requests wait for each other first, and only as many as it may have at once then wait
    among all: so callers take turns, however many requests one of them sends.

    Args:
        waiting: Requests of one caller that wait for their turn; more are refused, and with 0 also
            those that find all places taken.
    """

    def __init__(
        self, name: str, *, each: int, total: float = math.inf, waiting: int = 64, retry_s: int = 2
    ) -> None:
        self._what, self._each, self._total = name, each, total
        self._waiting, self._retry_s = waiting, retry_s
        self._all = CapacityLimiter(total)
        self._own: WeakValueDictionary[str, CapacityLimiter] = WeakValueDictionary()

    @asynccontextmanager
    async def of(self, caller: str) -> AsyncIterator[None]:
        """Keep a caller's place inside the block.

        Raises:
            ProblemError: 429 when the caller has as many as one may, 503 when all together have.
        """
        own = self._own.setdefault(caller, CapacityLimiter(self._each))
        if own.available_tokens < 1 and own.statistics().tasks_waiting >= self._waiting:
            raise self._full(ErrorCode.TOO_MANY_OPEN)
        if not self._waiting and self._all.available_tokens < 1:
            raise self._full(ErrorCode.BUSY)
        async with AsyncExitStack() as held:
            code = ErrorCode.TOO_MANY_OPEN
            try:
                async with asyncio.timeout(WAIT_S):
                    await held.enter_async_context(own)
                    code = ErrorCode.BUSY
                    await held.enter_async_context(self._all)
            except TimeoutError as error:
                raise self._full(code) from error
            yield

    def _full(self, code: ErrorCode) -> ProblemError:
        own = code == ErrorCode.TOO_MANY_OPEN
        whose = f"you have {self._each}" if own else f"the service has {self._total}"
        waiting = f", and {self._waiting} wait" if self._waiting else ""
        return ProblemError(
            code,
            f"{whose} {self._what} going on, as many as may be{waiting}",
            headers={"Retry-After": str(self._retry_s)},
        )


def usual_places() -> Mapping[Kind, Places]:
    """Return the limits of `docs/security.md` for one process."""
    return {
        # Fewer than there are threads and connections, so that one caller leaves some.
        "ordinary": Places("requests", each=8, retry_s=1),
        # Each occupies a core and the interpreter during its whole duration.
        "heavy": Places("heavy questions", each=1, total=2),
        # One process checks them, one after the other.
        "files": Places("checks of files", each=1, total=2),
        # Each may have 4 MB in memory.
        "bodies": Places("large bodies", each=4, total=32),
        # One may have 64 MB in memory until it is sent.
        "trajectories": Places("trajectories", each=4, total=12),
        "streams": Places("event streams", each=32, total=512, waiting=0, retry_s=5),
        "runner_waits": Places("waits for a trial", each=64, total=1000, waiting=0),
        # One may have a hundred megabytes in memory until it is scored.
        "runner_outcomes": Places("outcomes", each=2, total=3),
        # Each has up to 48 MB on the disk.
        "uploads": Places("uploads", each=2, total=24),
    }


class OpenRequests:
    """Middleware around everything else: cheap refusals of callers with too many open requests.

    Args:
        caller_of: Names a request's caller, as far as it is known without a lookup.
    """

    def __init__(self, app: ASGIApp, *, caller_of: Callable[[Scope], str]) -> None:
        self._app, self._who = app, caller_of
        self._open: Counter[str] = Counter()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, or refuse it."""
        if scope["type"] != "http" or scope["path"] == HEALTH_PATH:
            await self._app(scope, receive, send)
            return

        async def holding_send(message: Message) -> None:
            if message["type"] == "http.response.start" and message["status"] == 429:  # noqa: PLR2004 - Too Many Requests
                await asyncio.sleep(random.uniform(*HELD_S))  # noqa: S311 - nothing secret
            await send(message)

        caller_of = self._who(scope)
        if self._open[caller_of] >= MAX_OPEN:
            detail = f"you have {MAX_OPEN} requests open, as many as may be"
            wait = {"Retry-After": "1"}
            problem = ProblemError(ErrorCode.TOO_MANY_OPEN, detail, headers=wait)
            await problem.answer()(scope, receive, holding_send)
            return
        self._open[caller_of] += 1
        try:
            await self._app(scope, receive, holding_send)
        finally:
            self._open[caller_of] -= 1
            if not self._open[caller_of]:
                del self._open[caller_of]
