"""A cache that callers share, in which nobody pushes out what others use."""

from __future__ import annotations

from collections import OrderedDict
from typing import Generic, TypeVar

K = TypeVar("K")
V = TypeVar("V")


class FairCache(Generic[K, V]):
    """Values that were asked for; where it is full, whoever has the most loses their oldest.

    Whoever asks for what nobody asked for before, however often, pushes out only their own. Not
    safe for use from several threads at once.

    Args:
        max_values: Values at most.
    """

    def __init__(self, max_values: int) -> None:
        self._max_values = max_values
        self._values: dict[K, tuple[str, V]] = {}
        self._of: dict[str, OrderedDict[K, None]] = {}

    def get(self, key: K) -> V | None:
        """The value with a key, which counts as used now."""
        entry = self._values.get(key)
        if entry is None:
            return None
        who, value = entry
        self._of[who].move_to_end(key)
        return value

    def put(self, key: K, value: V, *, who: str) -> None:
        """Takes a value in.

        Args:
            key: Its key.
            value: The value.
            who: Whose share it counts for; that of the one before, if the key had one.
        """
        if key in self._values:
            who = self._values[key][0]
        elif len(self._values) >= self._max_values:
            self._drop_one()
        self._values[key] = who, value
        self._of.setdefault(who, OrderedDict())[key] = None

    def _drop_one(self) -> None:
        greatest = max(self._of, key=lambda who: len(self._of[who]))
        key, _ = self._of[greatest].popitem(last=False)
        if not self._of[greatest]:
            del self._of[greatest]
        del self._values[key]
