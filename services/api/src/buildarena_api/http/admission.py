"""Who sends a request, found from its headers alone, before a byte of its body is read.

A caller whom nobody knows gets no memory: requests without a good key are answered at once where
keys are asked for, and are counted by their address, however many keys are invented. What is read
of bodies is bounded for the whole process, for each caller, and in time.
"""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Final

from starlette.types import Message, Receive, Scope

PLACE: Final = "buildarena.place"
"""Where a request's scope has its `Place`."""
MAX_BUFFERED: Final = 256 * 1024 * 1024
"""Bytes of request bodies in memory of one process."""
MAX_BUFFERED_EACH: Final = 16 * 1024 * 1024
"""Bytes of one caller's bodies among them."""
WINDOW_S: Final = 10.0
WINDOW_BYTES: Final = 64 * 1024
"""A body that is not complete brings at least so many bytes in each window."""


class SlowBodyError(Exception):
    """A body does not come, or too slowly."""

    def __init__(self) -> None:
        super().__init__(f"less than {WINDOW_BYTES:,} bytes of the body came in {WINDOW_S:g} s")


class BuffersFullError(Exception):
    """As many bytes of bodies are in memory as may be.

    Attributes:
        is_of_the_caller: Whether they are the caller's own.
    """

    def __init__(self, *, is_of_the_caller: bool) -> None:
        super().__init__()
        self.is_of_the_caller = is_of_the_caller


@dataclass(slots=True)
class Place:
    """A request that is open, counted for somebody.

    Attributes:
        who: For whom: an address, until a good key says whose request it is.
    """

    who: str
    counts: Counter[str]

    def enter(self) -> None:
        """Counts the request."""
        self.counts[self.who] += 1

    def leave(self) -> None:
        """Counts it no more."""
        self.counts[self.who] -= 1
        if not self.counts[self.who]:
            del self.counts[self.who]

    def move(self, who: str) -> None:
        """Counts it for somebody else."""
        self.leave()
        self.who = who
        self.enter()


def who_is(scope: Scope) -> str:
    """For whom an open request counts."""
    place: Place | None = scope.get(PLACE)
    return address_of(scope) if place is None else place.who


def address_of(scope: Scope) -> str:
    """The address that a request came from, as a caller."""
    client = scope.get("client")
    return "address:unknown" if client is None else f"address:{client[0]}"


class BodyBuffers:
    """Bytes of request bodies that are in memory.

    Args:
        most: Of all callers together.
        most_each: Of one caller.
    """

    def __init__(self, *, most: int = MAX_BUFFERED, most_each: int = MAX_BUFFERED_EACH) -> None:
        self._most, self._most_each = most, most_each
        self._used: Counter[str] = Counter()
        self.total = 0

    @asynccontextmanager
    async def share(self, who: str) -> AsyncIterator[Callable[[int], None]]:
        """A share for one body; what it took is given back at the end of the block.

        Yields:
            A function that takes further bytes, and raises `BuffersFullError`.
        """
        taken = 0

        def take(size: int) -> None:
            nonlocal taken
            if self._used[who] + size > self._most_each:
                raise BuffersFullError(is_of_the_caller=True)
            if self.total + size > self._most:
                raise BuffersFullError(is_of_the_caller=False)
            self._used[who] += size
            self.total += size
            taken += size

        try:
            yield take
        finally:
            self.total -= taken
            self._used[who] -= taken
            if not self._used[who]:
                del self._used[who]


class PacedReceive:
    """Receives a body as long as it comes fast enough.

    Args:
        receive: What the server hands over.
        window_s: How long a window is.
        window_bytes: What comes in each at least.
    """

    def __init__(
        self, receive: Receive, *, window_s: float = WINDOW_S, window_bytes: int = WINDOW_BYTES
    ) -> None:
        self._receive = receive
        self._window_s, self._window_bytes = window_s, window_bytes
        self._ends_at: float | None = None
        self._came = 0
        self._is_complete = False

    async def __call__(self) -> Message:
        """The next message.

        Raises:
            SlowBodyError: Too little of the body came in a window.
        """
        if self._is_complete:
            return await self._receive()
        clock = asyncio.get_running_loop().time
        if self._ends_at is None:
            self._ends_at = clock() + self._window_s
        try:
            async with asyncio.timeout_at(self._ends_at):
                message = await self._receive()
        except TimeoutError as error:
            raise SlowBodyError from error
        self._came += len(message.get("body", b""))
        self._is_complete = not message.get("more_body", False)
        if self._came >= self._window_bytes:
            self._ends_at, self._came = clock() + self._window_s, 0
        return message


Admit = Callable[[Scope], Awaitable[None]]
"""Raises `ProblemError` for a request that may not be read, see `access.admit`."""
