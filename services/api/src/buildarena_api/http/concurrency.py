"""How much of something a caller may have going on at once.

Decided in the event loop, before a request takes a thread or a database connection.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field
from typing import Any

from fastapi import Depends, Request

from buildarena_api.http.access import Caller, caller_of, who_asks
from buildarena_api.http.problems import ProblemError
from buildarena_api.http.weights import weight_of

MAX_WAITING = 64
"""Requests of one caller that wait for their turn; more are refused."""


@dataclass(slots=True)
class _Share:
    who: str
    used: int = 0
    waiting: deque[asyncio.Future[None]] = field(default_factory=deque)


class ConcurrencyLimit:
    """A limit on what goes on at once.

    Args:
        what: What it limits, for messages.
        per_caller: How many one caller may have.
        total: How many all callers together may have.
        wait_s: How long one that finds its caller's share used up waits for its turn.
        retry_s: When a refused caller may come back.
        in_turns: Whether callers wait, and take turns, where all together have used up the total;
            they are refused otherwise.
    """

    def __init__(
        self,
        what: str,
        *,
        per_caller: int,
        total: int,
        wait_s: float = 0.0,
        retry_s: int = 2,
        in_turns: bool = False,
    ) -> None:
        self._what = what
        self._per_caller = per_caller
        self._total = total
        self._wait_s = wait_s
        self._retry_s = retry_s
        self._in_turns = in_turns
        self._used = 0
        self._shares: dict[str, _Share] = {}

    @asynccontextmanager
    async def slot(self, who: str, *, weight: int = 1) -> AsyncIterator[None]:
        """Keeps a place inside the block.

        Args:
            who: The caller.
            weight: What the question weighs, for the message.

        Raises:
            ProblemError: 429 when the caller has as many as one may, 503 when all together have.
        """
        share = self._shares.setdefault(who, _Share(who))
        try:
            await self._enter(share, weight)
            try:
                yield
            finally:
                self._leave(share)
        finally:
            if not share.used and not share.waiting:
                self._shares.pop(who, None)

    async def _enter(self, share: _Share, weight: int) -> None:
        is_full = self._used >= self._total
        if share.used >= self._per_caller or (is_full and self._in_turns):
            await self._wait(share, weight)  # the place of one that left is handed on
            return
        if is_full:
            message = f"the service has {self._total} {self._what} going on, as many as it may"
            raise self._refusal(503, message)
        share.used += 1
        self._used += 1

    async def _wait(self, share: _Share, weight: int) -> None:
        if not self._wait_s or len(share.waiting) >= MAX_WAITING:
            raise self._refusal(429, self._share_is_used(weight))
        turn: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        share.waiting.append(turn)
        try:
            async with asyncio.timeout(self._wait_s):
                await turn
        except BaseException as error:
            if turn.done() and not turn.cancelled():
                self._leave(share)  # the place came just as this one gave up
            with suppress(ValueError):
                share.waiting.remove(turn)
            if isinstance(error, TimeoutError):
                raise self._refusal(429, self._share_is_used(weight)) from error
            raise

    def _leave(self, share: _Share) -> None:
        share.used -= 1
        self._used -= 1
        if not self._in_turns:
            self._hand_on(share)
            return
        if self._shares.pop(share.who, None) is not None:
            self._shares[share.who] = share  # all others come before it now
        for other in self._shares.values():
            if other.used < self._per_caller and self._hand_on(other):
                return

    def _hand_on(self, share: _Share) -> bool:
        """Gives a place that came free to one that waits, if any of a caller's does."""
        while share.waiting:
            turn = share.waiting.popleft()
            if not turn.done():
                turn.set_result(None)
                share.used += 1
                self._used += 1
                return True
        return False

    def _share_is_used(self, weight: int) -> str:
        wait = f" and {MAX_WAITING} wait" if self._wait_s else ""
        weighs = f"; this one weighs {weight}, and no place is left for it" if weight > 1 else ""
        return (
            f"{self._per_caller} {self._what} are going on{wait}, as many as one caller may "
            f"have{weighs}"
        )

    def _refusal(self, status: int, detail: str) -> ProblemError:
        return ProblemError(status, detail, headers={"Retry-After": str(self._retry_s)})


@dataclass(frozen=True, slots=True, kw_only=True)
class ConcurrencyLimits:
    """The limits of one API process."""

    ordinary: ConcurrencyLimit
    heavy: ConcurrencyLimit
    files: ConcurrencyLimit
    streams: ConcurrencyLimit
    trajectories: ConcurrencyLimit
    runner_waits: ConcurrencyLimit
    runner_outcomes: ConcurrencyLimit


def usual_limits() -> ConcurrencyLimits:
    """What `docs/security.md` says."""
    return ConcurrencyLimits(
        # Fewer than there are threads and connections, so that one caller leaves some.
        ordinary=ConcurrencyLimit("requests", per_caller=8, total=1000, wait_s=30.0, retry_s=1),
        # Each takes a core and the interpreter for as long as it lasts: one caller's never have
        # more of these than another's light question.
        heavy=ConcurrencyLimit(
            "heavy questions", per_caller=1, total=2, wait_s=30.0, in_turns=True
        ),
        # One process checks them, one after the other.
        files=ConcurrencyLimit("checks", per_caller=1, total=2, wait_s=30.0, in_turns=True),
        streams=ConcurrencyLimit("event streams", per_caller=32, total=512, retry_s=5),
        # One may have 64 MB in memory until it is sent.
        trajectories=ConcurrencyLimit("trajectories", per_caller=4, total=12, wait_s=30.0),
        runner_waits=ConcurrencyLimit("waits for a trial", per_caller=64, total=1000),
        # One may have a hundred megabytes in memory until it is scored.
        runner_outcomes=ConcurrencyLimit("outcomes", per_caller=2, total=4, wait_s=30.0),
    )


def limited(
    kind: str | None = None,
    *,
    until: str = "function",
    caller: Callable[..., Awaitable[Caller]] = caller_of,
) -> Any:
    """A dependency: the caller's place among those of a kind.

    Args:
        kind: A field of `ConcurrencyLimits`; None for the lane of its weight.
        until: ``function``, or ``request`` to keep the place until the answer was sent.
        caller: The dependency that says who asks.
    """

    # Annotations are looked up outside of this function, where its arguments are not.
    async def take_place(request: Request, _: Caller = Depends(caller)) -> AsyncIterator[None]:  # noqa: B008
        limits: ConcurrencyLimits = request.app.state.concurrency
        weight = weight_of(request.scope)
        limit: ConcurrencyLimit = getattr(limits, kind or weight.lane)
        async with limit.slot(who_asks(request), weight=weight.units):
            yield

    scope: Any = until
    return Depends(take_place, scope=scope)
