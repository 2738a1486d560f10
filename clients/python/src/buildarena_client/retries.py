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
class RetryPolicy:
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


class Retries:
    """How one request is sent again.

    Args:
        request: What is sent.
        policy: How long to keep trying.
        now: Seconds of a clock that never goes back.
    """

    def __init__(self, request: Request, policy: RetryPolicy, *, now: float) -> None:
        self._request = request
        self._until: dict[int, float] = {HTTPStatus.TOO_MANY_REQUESTS: now + policy.too_many_s}
        self._breaks = 0
        if request.repeatable:
            self._until[HTTPStatus.SERVICE_UNAVAILABLE] = now + policy.unavailable_s
            self._breaks = policy.breaks

    def pause_after(self, response: Response, *, now: float) -> float | None:
        """Seconds to wait before it is sent again; None when it is not to be."""
        asked = response.retry_after
        until = self._until.get(response.status)
        if until is None or self._request.about_health or not asked.isdecimal():
            return None
        pause_s = min(float(asked), LONGEST_PAUSE_S)
        return None if now + pause_s > until else pause_s

    def pause_after_break(self) -> float | None:
        """As pause_after, when the connection broke off before the answer was whole."""
        if not self._breaks:
            return None
        self._breaks -= 1
        return BREAK_PAUSE_S


class RestartWatch:
    """How long a service that is watched may be away.

    Args:
        policy: How long to keep trying.
    """

    def __init__(self, policy: RetryPolicy) -> None:
        self._longest_s = policy.restart_s
        self._since: float | None = None

    def answered(self) -> None:
        """Notes that the service is there."""
        self._since = None

    def gives_up(self, *, now: float) -> bool:
        """Notes that it is not; whether that has been so for too long."""
        if self._since is None:
            self._since = now
        return now - self._since > self._longest_s
