"""Answers that take long to make, remembered as long as there is room."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from threading import Lock

from cachetools import LRUCache

from buildarena_api.http.etags import Answer


class ResponseCache:
    """The answers that were used last, by what they are made from.

    Args:
        max_bytes: Their bytes together at most.
    """

    def __init__(self, max_bytes: int) -> None:
        self._cached: LRUCache[str, Answer] = LRUCache(
            max_bytes, getsizeof=lambda answer: len(answer.body)
        )
        self._lock = Lock()
        self._making = Lock()

    def get_or_make(self, key: str, make: Callable[[], bytes]) -> Answer:
        """The answer with a key.

        Args:
            key: Names everything that it is made from.
            make: Makes its body, one at a time in the process: a large one takes all of a core.
        """
        cached = self._find(key)
        if cached is not None:
            return cached
        with self._making:
            cached = self._find(key)
            if cached is None:
                cached = Answer.of(make())
                # One that is larger than the cache is not stored.
                with self._lock, suppress(ValueError):
                    self._cached[key] = cached
            return cached

    def _find(self, key: str) -> Answer | None:
        with self._lock:
            return self._cached.get(key)
