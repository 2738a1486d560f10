"""Reading of untrusted files in a separate process, whose crash affects only one file."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from functools import partial
from importlib import import_module
from typing import Any, Final, Generic, TypeVar

import structlog

from buildarena_backend.errors import UploadError
from buildarena_benchmark.environment.trials.warm_process import ProcessEndedError, WarmProcess

TRIES: Final = 2
"""Number of attempts to read a file whose process was killed."""
T = TypeVar("T")

log = structlog.get_logger(__name__)


class Checker(Generic[T]):
    """Reads files in a separate process, one at a time; it starts with the first, ends with ours.

    Args:
        read: Called there; picklable by name. An `UploadError` is its answer too.
        spare_bytes: Memory for one file.
        longest_s: Time for one file.
    """

    def __init__(
        self, name: str, read: Callable[..., T], *, spare_bytes: int, longest_s: float
    ) -> None:
        self._name, self._longest_s = name, longest_s
        self._process = WarmProcess(name, partial(_reading, read), spare_bytes=spare_bytes)
        self._lock = threading.Lock()

    def ask(self, *question: Any) -> T:
        """Return the process' result for some arguments, all of them picklable.

        A process that something kills from outside loses nothing: the file is read again.

        Raises:
            UploadError: It is refused, or takes too long or too much memory.
        """
        with self._lock:
            until = time.monotonic() + self._longest_s

            def meanwhile() -> None:
                if time.monotonic() > until:
                    raise UploadError(f"it can't be read within {self._longest_s:.0f} s")

            for left in reversed(range(TRIES)):
                try:
                    refusal, answer = self._process.ask(question, meanwhile=meanwhile)
                    break
                except ProcessEndedError as error:
                    log.warning("file_check_ended", checker=self._name, code=error.code)
                    was_killed = error.code is not None and error.code < 0
                    if not was_killed or not left:
                        detail = "it can't be read within the memory it may take"
                        raise UploadError(detail) from error
        if refusal is not None:
            raise UploadError(refusal)
        result: T = answer
        return result

    def close(self) -> None:
        """End the process."""
        self._process.close()


def _reading(read: Callable[..., Any]) -> Callable[[Any], tuple[str | None, Any]]:
    import_module("pyarrow.parquet")  # before memory is limited
    return partial(_read, read)


def _read(read: Callable[..., Any], question: Any) -> tuple[str | None, Any]:
    try:
        return None, read(*question)
    except UploadError as error:
        return str(error), None
