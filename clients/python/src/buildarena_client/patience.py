"""When a request is sent again: one rule for both clients.

A request that was refused as one too many (429) was not begun, so any may be sent again. After 503,
or a connection that broke off, a change may have been made: only what may be carried out twice is
sent again. Nothing is sent again after a time-out, which has cost long enough.
"""

from __future__ import annotations

from dataclasses import dataclass
from http import HTTPStatus
from typing import Final

from buildarena_client.requests import Request, Response

LONGEST_PAUSE_S: Final = 10.0
"""How long a refused request waits at most before it is sent again, whatever the service asks."""
BREAK_PAUSE_S: Final = 0.2


@dataclass(frozen=True, slots=True, kw_only=True)
class Patience:
    """How long a client keeps trying.

    Attributes:
        too_many_s: While the service says that the caller asks too much (429).
        unavailable_s: While the service says that it can't answer now (503).
        breaks: How often a request is sent again whose connection broke off.
        restart_s: While a service that is watched does not answer at all: it may be restarted.
    """

    too_many_s: float = 60.0
    unavailable_s: float = 10.0
    breaks: int = 2
    restart_s: float = 60.0


class Waiting:
    """One request's patience.

    Args:
        request: What is sent.
        patience: How long to keep trying.
        now: Seconds of a clock that never goes back.
    """

    def __init__(self, request: Request, patience: Patience, *, now: float) -> None:
        self._request = request
        self._until = {HTTPStatus.TOO_MANY_REQUESTS: now + patience.too_many_s}
        self._breaks = 0
        if request.repeatable:
            self._until[HTTPStatus.SERVICE_UNAVAILABLE] = now + patience.unavailable_s
            self._breaks = patience.breaks

    def pause_after(self, response: Response, *, now: float) -> float | None:
        """Seconds to wait before it is sent again; None when it is not to be."""
        asked = response.retry_after
        status = response.status
        if self._request.about_health or not asked.isdecimal():
            return None
        until = next((end for of, end in self._until.items() if of == status), None)
        pause_s = min(float(asked), LONGEST_PAUSE_S)
        return None if until is None or now + pause_s > until else pause_s

    def pause_after_break(self) -> float | None:
        """As pause_after, when the connection broke off before the answer was whole."""
        if not self._breaks:
            return None
        self._breaks -= 1
        return BREAK_PAUSE_S


class Restarting:
    """The patience of somebody who watches: the service may be away for a while.

    Args:
        patience: How long to keep trying.
    """

    def __init__(self, patience: Patience) -> None:
        self._longest_s = patience.restart_s
        self._since: float | None = None

    def answered(self) -> None:
        """Notes that the service is there."""
        self._since = None

    def gives_up(self, *, now: float) -> bool:
        """Notes that it is not; whether that has been so for too long."""
        if self._since is None:
            self._since = now
        return now - self._since > self._longest_s
