"""Files that arrive whole or not at all."""

from __future__ import annotations

import hashlib
import uuid
from pathlib import Path
from types import TracebackType
from typing import Self

from buildarena_client.errors import DamagedError


class WholeFile:
    """A file that appears only when it is complete and has its hash.

    Args:
        target: Where.
        sha256: The hash that its bytes must have, if it is known.
    """

    def __init__(self, target: Path, sha256: str | None = None) -> None:
        self._target = target
        self._sha256 = sha256
        # Two downloads of one file do not write into each other's.
        self._partial = target.with_name(f".{target.name}.{uuid.uuid4().hex[:8]}.partial")
        self._hash = hashlib.sha256()

    def __enter__(self) -> Self:
        self._file = self._partial.open("xb")
        return self

    def write(self, chunk: bytes) -> None:
        """Writes what comes next."""
        self._hash.update(chunk)
        self._file.write(chunk)

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        try:
            self._file.close()
            if error is None:
                _compare(self._hash.hexdigest(), self._sha256, self._target.name)
                self._partial.replace(self._target)
        finally:
            self._partial.unlink(missing_ok=True)


def require_hash(data: bytes, sha256: str, name: str) -> bytes:
    """Bytes that arrived as they were stored.

    Raises:
        DamagedError: They did not.
    """
    _compare(hashlib.sha256(data).hexdigest(), sha256, name)
    return data


def _compare(digest: str, expected: str | None, name: str) -> None:
    if expected is not None and digest != expected:
        raise DamagedError(f"{name} arrived damaged: its hash differs")
