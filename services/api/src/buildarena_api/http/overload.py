"""Refusals that cost next to nothing, for callers who send far more than they may.

A refusal that passed the key check, the rate limit and the log costs about a millisecond of the
event loop, so that hundreds at once would delay everybody. Who has too many requests open, or was
told to come back later and did not wait, is therefore answered before any of these; and after a
while only, as whoever asks again at once would be refused thousands of times in a second.
"""

from __future__ import annotations

import asyncio
import random
import time
from collections import Counter
from collections.abc import Callable
from typing import Final

import structlog
from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from buildarena_api.http.admission import PLACE, Place, address_of
from buildarena_api.http.problems import send_problem
from buildarena_api.http.weights import WEIGHT, Weights

MAX_IN_FLIGHT: Final = 96
"""Requests of one caller that are open at once: its streams, and as many ordinary ones again
as can wait for their turn."""
LONGEST_S: Final = 5.0
"""How long a caller who was told to wait is refused at the door."""
MAX_REMEMBERED: Final = 10_000
LOG_EVERY_S: Final = 1.0
HELD_S: Final = (0.5, 1.0)
"""How long a refusal at the door is held back: not as long for all, or they come again together."""
MAX_HELD: Final = 1000
"""Refusals of a process that are held back; more are sent at once."""

log = structlog.get_logger(__name__)


class OverloadMiddleware:
    """Middleware around everything else.

    Args:
        app: The application.
        known: Whose key a secret is, if it was seen to be good lately: nothing is asked.
        weights: Weighs requests.
    """

    def __init__(
        self, app: ASGIApp, *, known: Callable[[str], str | None], weights: Weights
    ) -> None:
        self._app = app
        self._known = known
        self._weights = weights
        self._held = 0
        self._in_flight: Counter[str] = Counter()
        self._not_before: dict[tuple[str, str, str], float] = {}
        self._refused = 0
        self._logged_at = 0.0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Passes a request on, or refuses it at once."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        who = self._who(scope)
        weight = self._weights.of(scope)
        what = f"{scope['method']} {scope['path'].rpartition('/')[2]}", weight.lane
        wait_s = self._not_before.get((who, *what), 0.0) - time.monotonic()
        if wait_s > 0 or self._in_flight[who] >= MAX_IN_FLIGHT:
            await self._refuse(send, max(1, round(wait_s)))
            return

        async def noting_send(message: Message) -> None:
            if message["type"] == "http.response.start" and message["status"] == 429:  # noqa: PLR2004 - Too Many Requests
                self._remember((place.who, *what), message)
            await send(message)

        place = Place(who, self._in_flight)
        place.enter()
        try:
            await self._app({**scope, PLACE: place, WEIGHT: weight}, receive, noting_send)
        finally:
            place.leave()

    def _who(self, scope: Scope) -> str:
        """Whose request it is: that of a key known to be good, or of its address.

        A key that nobody checked yet proves nothing: whoever invents one for each request has one
        address.
        """
        scheme, _, secret = Headers(scope=scope).get("authorization", "").partition(" ")
        key_id = self._known(secret.strip()) if scheme.lower() == "bearer" else None
        return key_id or address_of(scope)

    def _remember(self, what: tuple[str, str, str], refusal: Message) -> None:
        asked = Headers(raw=refusal["headers"]).get("retry-after", "")
        if not asked.isdecimal():
            return
        now = time.monotonic()
        if len(self._not_before) >= MAX_REMEMBERED:
            self._not_before = {one: at for one, at in self._not_before.items() if at > now}
        if len(self._not_before) < MAX_REMEMBERED:
            # A little less than was asked for: clocks differ.
            self._not_before[what] = now + 0.9 * min(float(asked), LONGEST_S)

    async def _refuse(self, send: Send, wait_s: int) -> None:
        self._refused += 1
        now = time.monotonic()
        if now - self._logged_at > LOG_EVERY_S:
            log.warning("overload_refused", requests=self._refused)
            self._logged_at, self._refused = now, 0
        if self._held < MAX_HELD:
            self._held += 1
            try:
                await asyncio.sleep(random.uniform(*HELD_S))  # noqa: S311 - nothing secret
            finally:
                self._held -= 1
        detail = "too many requests of yours are open or came too early: wait as Retry-After says"
        await send_problem(send, 429, detail, headers={"Retry-After": str(wait_s)})
