"""Files that arrive whole or not at all."""

from __future__ import annotations

import hashlib
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from io import BufferedRandom, BytesIO
from pathlib import Path

from buildarena_client.errors import DamagedError


@contextmanager
def whole_file(target: Path, sha256: str | None = None) -> Iterator[BufferedRandom]:
    """Yield a file that appears only when it is complete and has its hash, if known.

    Raises:
        DamagedError: Its hash differs.
    """
    # Two downloads of one file do not write into each other's.
    partial = target.with_name(f".{target.name}.{uuid.uuid4().hex[:8]}.partial")
    try:
        with partial.open("x+b") as file:
            yield file
            file.seek(0)
            require_hash(file, sha256, target.name)
        partial.replace(target)
    finally:
        partial.unlink(missing_ok=True)


def require_hash(content: BufferedRandom | BytesIO, sha256: str | None, name: str) -> None:
    """Check that bytes arrived as stored, if their hash is known.

    Raises:
        DamagedError: The hash differs.
    """
    if sha256 is not None and hashlib.file_digest(content, "sha256").hexdigest() != sha256:
        raise DamagedError(f"{name} arrived damaged: its hash differs")
