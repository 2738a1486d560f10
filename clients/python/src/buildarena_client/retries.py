"""Limits for repeating requests."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class RetryPolicy:
    """Limits for repeating requests.

    Attributes:
        too_many_s: Time for which requests over the rate limit (429) are repeated, seconds.
        unavailable_s: Time for which requests to an unavailable service (503) are repeated,
            seconds.
        breaks: Number of repetitions after broken connections.
        restart_s: Time for which a watched service may not answer at all, for example during a
            restart, seconds.
    """

    too_many_s: float = 60.0
    unavailable_s: float = 10.0
    breaks: int = 2
    restart_s: float = 60.0
