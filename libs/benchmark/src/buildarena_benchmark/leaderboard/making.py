"""What summaries are made by, so that those that were kept are not taken for those of today."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from hashlib import blake2b
from importlib.resources import files
from importlib.resources.abc import Traversable

import numpy as np
import scipy


@cache
def summaries_made_by() -> str:
    """A hash of this library and of what it computes with: another one may summarise otherwise.

    All of the library rather than the files that matter today: which these are is soon forgotten,
    and summaries are made again in a second.
    """
    digest = blake2b(f"{np.__version__} {scipy.__version__}".encode(), digest_size=12)
    for name, file in sorted(_files(files("buildarena_benchmark"), "")):
        digest.update(f"{name}\0".encode() + file.read_bytes())
    return digest.hexdigest()


def _files(folder: Traversable, path: str) -> Iterator[tuple[str, Traversable]]:
    for entry in folder.iterdir():
        if entry.is_file():
            yield f"{path}/{entry.name}", entry
        elif entry.name != "__pycache__":
            yield from _files(entry, f"{path}/{entry.name}")
