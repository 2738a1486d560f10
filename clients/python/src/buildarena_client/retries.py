"""How long a client keeps trying."""

from __future__ import annotations

from dataclasses import dataclass


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
