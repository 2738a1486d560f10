"""The retry policy for model requests: declared, bounded, and honouring Retry-After."""

from __future__ import annotations

import random
from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class RetryPolicy:
    """How often and how long a request is tried.

    Attributes:
        attempts: Sendings at most.
        first_wait_s: Longest wait after the first failure; doubles with each.
        longest_wait_s: No wait is longer, whatever a provider asks for.
        timeout_s: Time for one sending, connection included.
    """

    attempts: int = 6
    first_wait_s: float = 1.0
    longest_wait_s: float = 60.0
    timeout_s: float = 600.0

    def wait_s(self, failures: int, headers: Mapping[str, str] | None, rng: random.Random) -> float:
        """How long to wait after this many failures.

        What the provider asks for in Retry-After counts; otherwise a random part of a doubling
        wait, so that workers do not come back all at once.
        """
        asked = _retry_after(headers)
        if asked is not None:
            return min(asked, self.longest_wait_s)
        ceiling = min(self.longest_wait_s, self.first_wait_s * 2 ** (failures - 1))
        return rng.uniform(ceiling / 2, ceiling)


def _retry_after(headers: Mapping[str, str] | None) -> float | None:
    if headers is None:
        return None
    for name, scale in (("retry-after-ms", 0.001), ("retry-after", 1.0)):
        try:
            return max(0.0, float(headers[name]) * scale)
        except (KeyError, ValueError):
            continue
    return None
