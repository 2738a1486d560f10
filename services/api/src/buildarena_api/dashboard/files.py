"""The built pages, read once: what is not among them can't be asked for."""

from __future__ import annotations

import mimetypes
from collections.abc import Mapping
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from typing import Final

FOLDER: Final = Path(__file__).resolve().parent.parent / "pages"
"""Where `make web` puts them, and where wheels carry them."""
INDEX: Final = "/index.html"
ENCODINGS: Final = {"br": ".br", "gzip": ".gz"}
"""Content encodings, the better first, and the suffix of a file's copy in each."""
HASHED: Final = "/assets/"
"""Below it a file's name has the hash of its content."""
_TYPES: Final = {".js": "text/javascript", ".wasm": "application/wasm", ".svg": "image/svg+xml"}
"""Spelled out: the system's table may say otherwise, and browsers run no script of another type."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PageFile:
    """A file of the built pages.

    Attributes:
        data: Its bytes.
        media_type: What it is.
        etag: The hash of its bytes.
        immutable: Whether its name has the hash of its content, so that it never changes.
        encoded: Its bytes compressed, by content encoding.
    """

    data: bytes
    media_type: str
    etag: str
    immutable: bool
    encoded: Mapping[str, bytes] = field(default_factory=dict)


def read_pages(folder: Path = FOLDER) -> dict[str, PageFile]:
    """The built pages by path; none where they were not built.

    Args:
        folder: Where they are.
    """
    if not (folder / INDEX.removeprefix("/")).is_file():
        return {}
    found = {
        "/" + file.relative_to(folder).as_posix(): file
        for file in sorted(folder.rglob("*"))
        if file.is_file() and not file.name.startswith(".")
    }
    copies = {path + suffix for path in found for suffix in ENCODINGS.values()}
    return {
        path: _page_file(path, file, found) for path, file in found.items() if path not in copies
    }


def _page_file(path: str, file: Path, found: Mapping[str, Path]) -> PageFile:
    data = file.read_bytes()
    kind = _TYPES.get(file.suffix) or mimetypes.guess_type(path)[0] or "application/octet-stream"
    return PageFile(
        data=data,
        media_type=f"{kind}; charset=utf-8" if kind.startswith("text/") else kind,
        etag=f'"{sha256(data).hexdigest()[:32]}"',
        immutable=path.startswith(HASHED),
        encoded={
            encoding: found[path + suffix].read_bytes()
            for encoding, suffix in ENCODINGS.items()
            if path + suffix in found
        },
    )
