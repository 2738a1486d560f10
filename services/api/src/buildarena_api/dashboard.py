"""The built pages: read once, and served where no route of the API answers."""

from __future__ import annotations

import gzip
import mimetypes
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from hashlib import sha256
from http import HTTPStatus
from pathlib import Path
from typing import Final

from starlette.datastructures import Headers
from starlette.responses import HTMLResponse, Response
from starlette.types import ASGIApp, Receive, Scope, Send

from buildarena_backend.settings import PAGES

FOLDER: Final = Path(__file__).resolve().parent / "pages"
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
    """Return the built pages by path; none where they were not built.

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
    """Return the first page with addresses below a base path, which it also tells its scripts."""
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


PAGE: Final = re.compile(rf"/(?:(?:{'|'.join(PAGES)})(?:/[^\x00-\x1f\x7f]*)?)?")
"""Addresses of pages: the page itself reads which, so all of them get the same file."""
_SOURCES: Final = {
    "default-src": "'none'",
    "script-src": "'self'",
    # The component library sets its variables in a style element.
    "style-src": "'self' 'unsafe-inline'",
    "img-src": "'self' data: blob:",
    "font-src": "'self'",
    "connect-src": "'self'",
    "base-uri": "'none'",
    "form-action": "'none'",
    "frame-ancestors": "'none'",
}
POLICY: Final = "; ".join(f"{what} {where}" for what, where in _SOURCES.items())
"""What a page may load and run: its own files only, and no script that stands in a page."""
NOT_BUILT: Final = """<!doctype html>
<html lang="en"><meta charset="utf-8"><title>BuildArena</title>
<h1>BuildArena</h1>
<p>The service runs; its dashboard has not been built. <code>make web</code> builds it, and the
service shows it here after its next start.</p>
<p>Meanwhile: the API's <a href="{base}/docs">documentation</a> and the
<a href="{base}/v1/leaderboard">leaderboard as JSON</a>.</p>
</html>
"""


API: Final = re.compile(r"/(?:v1|docs|openapi\.json|static-offline-docs|assets)(?:/|$)")
"""Paths whose answers are for programs, whoever asks."""


def is_page(path: str) -> bool:
    """Return whether a path is a page's; no route of the API has such a path."""
    return PAGE.fullmatch(path) is not None


class Dashboard:
    """An ASGI application for the paths that no route has.

    Args:
        files: The built pages by path.
        otherwise: What answers when it is no page either.
        base: Path below which a proxy shows the service.
    """

    def __init__(
        self,
        files: Mapping[str, PageFile],
        otherwise: ASGIApp,
        *,
        base: str = "",
    ) -> None:
        self._not_built = NOT_BUILT.format(base=base)
        self._files = files
        self._otherwise = otherwise

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer with a page or one of its files, or pass the request on."""
        found = self._find(scope) if scope["type"] == "http" else None
        await (found or self._otherwise)(scope, receive, send)

    def _find(self, scope: Scope) -> Response | None:
        path = scope["path"].removeprefix(scope.get("root_path", ""))
        if scope["method"] not in {"GET", "HEAD"}:
            return None
        headers = Headers(scope=scope)
        if path != INDEX and path in self._files:
            return _answer(self._files[path], headers)
        if not is_page(path):
            return self._missing(path, headers)
        if INDEX not in self._files:
            return HTMLResponse(self._not_built, headers={"Content-Security-Policy": POLICY})
        return _answer(self._files[INDEX], headers)

    def _missing(self, path: str, headers: Headers) -> Response | None:
        """The page that says so, for people: somebody's browser opened the address itself."""
        is_visit = headers.get("sec-fetch-dest") == "document"
        if INDEX not in self._files or not is_visit or API.match(path):
            return None
        answer = _answer(self._files[INDEX], headers)
        answer.status_code = 404 if answer.status_code == HTTPStatus.OK else answer.status_code
        return answer


def _answer(file: PageFile, headers: Headers) -> Response:
    encoding = _accepted(headers.get("accept-encoding", ""), file.encoded)
    # Each encoding is another body, so it has another tag.
    etag = file.etag if encoding is None else f'{file.etag[:-1]}-{encoding}"'
    answer = {
        "ETag": etag,
        "Cache-Control": "public, max-age=31536000, immutable" if file.immutable else "no-cache",
        "Vary": "Accept-Encoding",
        "Content-Security-Policy": POLICY,
    }
    if etag in [tag.strip() for tag in headers.get("if-none-match", "").split(",")]:
        return Response(status_code=304, headers=answer)
    if encoding is not None:
        answer["Content-Encoding"] = encoding
    data = file.data if encoding is None else file.encoded[encoding]
    return Response(data, media_type=file.media_type, headers=answer)


def _accepted(accept: str, encoded: Mapping[str, bytes]) -> str | None:
    """Return the best encoding there is that the reader accepts."""
    weights: dict[str, float] = {}
    for entry in accept.split(","):
        name, _, quality = entry.partition(";")
        weight = re.fullmatch(r"\s*q\s*=\s*([01](?:\.[0-9]{0,3})?)\s*", quality)
        weights[name.strip().lower()] = 1.0 if weight is None else float(weight[1])
    return next((name for name in encoded if weights.get(name, 0.0) > 0), None)
