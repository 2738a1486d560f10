"""Files that arrive whole or not at all."""

from __future__ import annotations

import hashlib
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from buildarena_client.errors import DamagedError


@contextmanager
def whole_file(target: Path, sha256: str | None = None) -> Iterator[BinaryIO]:
    """A file that appears only when it is complete and has its hash, if that is known.

    Raises:
        DamagedError: It has another.
    """
    # Two downloads of one file do not write into each other's.
    partial = target.with_name(f".{target.name}.{uuid.uuid4().hex[:8]}.partial")
    try:
        with partial.open("x+b") as file:
            yield file
            file.seek(0)
            _compare(hashlib.file_digest(file, "sha256").hexdigest(), sha256, target.name)
        partial.replace(target)
    finally:
        partial.unlink(missing_ok=True)


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
