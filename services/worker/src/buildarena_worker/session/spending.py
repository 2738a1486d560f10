"""Use of a session, and the job's limits on it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from decimal import Decimal
from typing import Any

from buildarena_backend.journal.journal import JournalEntry, Usage
from buildarena_worker.session.results import LimitReached, SessionEnded


@dataclass(slots=True)
class Spending:
    """Use of a session so far, replayed answers included.

    Attributes:
        limits: The job's limits by name.
        usage: Requests, tokens and money.
        seconds: Time that its model took.
    """

    limits: Mapping[str, Any]
    usage: Usage = field(default_factory=Usage)
    seconds: float = 0.0

    def add(self, entry: JournalEntry) -> None:
        """Count an answer."""
        self.usage += entry.usage
        self.seconds += entry.latency_s

    @property
    def seconds_left(self) -> float:
        """Seconds until the job's limit; infinite without a limit."""
        return self._most_seconds - self.seconds

    def to_the_end(self, latency_s: float) -> float:
        """Return the latency of an answer that did not arrive in time, which reaches the limit."""
        while self.seconds + latency_s < self._most_seconds < math.inf:
            latency_s = max(latency_s, self.seconds_left) + math.ulp(self.seconds + latency_s)
        return latency_s

    @property
    def _most_seconds(self) -> float:
        limit = self.limits.get("max_duration_s")
        return math.inf if limit is None else float(limit)

    def require_room(self) -> None:
        """Check that the session may send another request.

        Raises:
            SessionEnded: A limit is reached.
        """
        spent: dict[str, float | Decimal] = {
            "max_requests": self.usage.requests,
            "max_tokens": self.usage.input_tokens + self.usage.output_tokens,
            "max_cost_usd": self.usage.cost_usd,
            "max_duration_s": self.seconds,
        }
        for name, value in spent.items():
            limit = self.limits.get(name)
            if limit is not None and float(value) >= float(limit):
                detail = f"{name} is {limit}, the session used {value}"
                raise SessionEnded(LimitReached(limit=name, detail=detail))
