"""The built pages, read once: what is not among them can't be asked for."""

from __future__ import annotations

import gzip
import mimetypes
import re
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
BASE_NAME: Final = "buildarena-base"
"""The meta element that tells the scripts of a base path."""
_ADDRESS: Final = re.compile(r'\b(src|href)="/(?!/)')
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


def read_pages(folder: Path = FOLDER, *, base: str = "") -> dict[str, PageFile]:
    """The built pages by path; none where they were not built.

    Args:
        folder: Where they are.
        base: Path below which a proxy shows them, for example ``/arena``.
    """
    if not (folder / INDEX.removeprefix("/")).is_file():
        return {}
    found = {
        "/" + file.relative_to(folder).as_posix(): file
        for file in sorted(folder.rglob("*"))
        if file.is_file() and not file.name.startswith(".")
    }
    copies = {path + suffix for path in found for suffix in ENCODINGS.values()}
    pages = {
        path: _page_file(path, file, found) for path, file in found.items() if path not in copies
    }
    if base:
        pages[INDEX] = _below(base, pages[INDEX])
    return pages


def _below(base: str, index: PageFile) -> PageFile:
    """The first page with addresses below a base path, which it also tells its scripts."""
    text = index.data.decode()
    text = _ADDRESS.sub(rf'\1="{base}/', text)
    text = text.replace("<head>", f'<head>\n    <meta name="{BASE_NAME}" content="{base}" />', 1)
    data = text.encode()
    return PageFile(
        data=data,
        media_type=index.media_type,
        etag=_tag(data),
        immutable=False,
        encoded={"gzip": gzip.compress(data, mtime=0)},
    )


def _page_file(path: str, file: Path, found: Mapping[str, Path]) -> PageFile:
    data = file.read_bytes()
    kind = _TYPES.get(file.suffix) or mimetypes.guess_type(path)[0] or "application/octet-stream"
    return PageFile(
        data=data,
        media_type=f"{kind}; charset=utf-8" if kind.startswith("text/") else kind,
        etag=_tag(data),
        immutable=path.startswith(HASHED),
        encoded={
            encoding: found[path + suffix].read_bytes()
            for encoding, suffix in ENCODINGS.items()
            if path + suffix in found
        },
    )


def _tag(data: bytes) -> str:
    return f'"{sha256(data).hexdigest()[:32]}"'
