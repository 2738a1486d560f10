"""Answers that take long to make, remembered as long as there is room."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from threading import Lock

from buildarena_api.http.etags import Answer


class KeptAnswers:
    """The answers that were used last, by what they are made from.

    Args:
        max_bytes: Their bytes together at most.
    """

    def __init__(self, max_bytes: int) -> None:
        self._max_bytes = max_bytes
        self._kept: OrderedDict[str, Answer] = OrderedDict()
        self._bytes = 0
        self._lock = Lock()
        self._making = Lock()

    def get_or_make(self, key: str, make: Callable[[], bytes]) -> Answer:
        """The answer with a key.

        Args:
            key: Names everything that it is made from.
            make: Makes its body, one at a time in the process: a large one takes all of a core.
        """
        known = self._find(key)
        if known is not None:
            return known
        with self._making:
            known = self._find(key)
            if known is None:
                known = Answer.of(make())
                self._keep(key, known)
            return known

    def _find(self, key: str) -> Answer | None:
        with self._lock:
            known = self._kept.get(key)
            if known is not None:
                self._kept.move_to_end(key)
            return known

    def _keep(self, key: str, answer: Answer) -> None:
        with self._lock:
            self._kept[key] = answer
            self._bytes += len(answer.body)
            while self._bytes > self._max_bytes:
                _, dropped = self._kept.popitem(last=False)
                self._bytes -= len(dropped.body)
