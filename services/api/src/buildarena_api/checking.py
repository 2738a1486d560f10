"""Strangers' files are read in a process apart: one that bursts it costs that file, and no more."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any, Final

import structlog

from buildarena_benchmark.environment.trials.warm_process import ProcessEndedError, WarmProcess

TRIES: Final = 2
"""How often a file is read whose process was killed: by its own fault, or by nobody's."""

log = structlog.get_logger(__name__)


class CheckFailedError(Exception):
    """A file can't be read within the bounds; the message says which."""


class Checker:
    """Reads files in a process apart, one at a time; it begins with the first and ends with ours.

    Args:
        name: What the process is called in messages.
        make: Called there first, makes what reads; both must be picklable by name.
        spare_bytes: Memory for one file.
        longest_s: Time for one file.
    """

    def __init__(
        self,
        name: str,
        make: Callable[[], Callable[[Any], Any]],
        *,
        spare_bytes: int,
        longest_s: float,
    ) -> None:
        self._name, self._longest_s = name, longest_s
        self._process = WarmProcess(name, make, spare_bytes=spare_bytes)
        self._lock = threading.Lock()

    def ask(self, question: Any) -> Any:
        """Return the answer of the process.

        A process that something kills from outside loses nothing: the file is read again.

        Args:
            question: Anything that can be pickled.

        Raises:
            CheckFailedError: It takes too long or too much memory.
        """
        with self._lock:
            until = time.monotonic() + self._longest_s

            def meanwhile() -> None:
                if time.monotonic() > until:
                    raise CheckFailedError(f"it can't be read within {self._longest_s:.0f} s")

            for left in reversed(range(TRIES)):
                try:
                    return self._process.ask(question, meanwhile=meanwhile)
                except ProcessEndedError as error:
                    log.warning("file_check_ended", checker=self._name, code=error.code)
                    was_killed = error.code is not None and error.code < 0
                    if not was_killed or not left:
                        detail = "it can't be read within the memory it may take"
                        raise CheckFailedError(detail) from error
        raise AssertionError  # the last try returns or raises

    def close(self) -> None:
        """End the process."""
        self._process.close()
