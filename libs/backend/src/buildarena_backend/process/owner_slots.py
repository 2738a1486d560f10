"""Owner slots: how many of a process' slots the jobs of one owner may have at once.

An owner may take a further slot only while it has fewer than four times as many as are free
(dynamic thresholds; Choudhury and Hahne, 1998). So one owner alone never takes all, and there is
room for the next one's first job at once; with five slots for every four that are configured, one
owner alone still gets as many as are configured.
"""

from __future__ import annotations

import math
from collections import Counter

ALPHA = 4
"""Slots that an owner may have for each free one."""


class OwnerSlots:
    """The slots of one process; its user sees to it that one thread at a time takes one.

    Args:
        configured: Slots that one owner alone gets.

    Attributes:
        total: Slots of all owners together.
    """

    def __init__(self, configured: int) -> None:
        self._configured = configured
        self.total = math.ceil(configured * (ALPHA + 1) / ALPHA)
        self._taken: Counter[str] = Counter()

    @property
    def free(self) -> int:
        """Slots that nobody has."""
        return self.total - self._taken.total()

    def full(self) -> list[str]:
        """Owners that may not take another slot now."""
        free = self.free
        return [
            owner
            for owner, taken in self._taken.items()
            # The last one is left to an owner that has none.
            if free <= 1 or taken >= min(self._configured, ALPHA * free)
        ]

    def take(self, owner: str) -> None:
        """Gives an owner a slot."""
        self._taken[owner] += 1

    def give_back(self, owner: str) -> None:
        """Takes a slot back."""
        self._taken[owner] -= 1
        if not self._taken[owner]:
            del self._taken[owner]
