"""The built pages, served where no route of the API answers."""

from __future__ import annotations

import mimetypes
import re
from collections.abc import Callable, Iterable
from html import escape
from http import HTTPStatus
from pathlib import Path
from typing import Final

from starlette.concurrency import run_in_threadpool
from starlette.datastructures import URL, Headers
from starlette.responses import FileResponse, HTMLResponse, Response
from starlette.types import ASGIApp, Receive, Scope, Send

from buildarena_api.http.etags import Answer, has_tag
from buildarena_backend.settings import PAGES

FOLDER: Final = Path(__file__).resolve().parent / "pages"
"""Folder of the pages that `make web` builds and wheels contain."""
INDEX: Final = "/index.html"
ENCODINGS: Final = {"br": ".br", "gzip": ".gz"}
"""Content encodings, the better first, and the suffix of a file's copy in each."""
HASHED: Final = "/assets/"
"""Below it a file's name has the hash of its content."""
FILE: Final = re.compile(r"/(?:assets/)?[A-Za-z0-9_-][A-Za-z0-9._-]{0,200}")
"""Addresses of files; those of the folder begin with no dot."""
BASE_NAME: Final = "buildarena-base"
"""The meta element with the base path, for scripts."""
_ADDRESS: Final = re.compile(r'\b(src|href)="/(?!/)')
_TYPES: Final = {".js": "text/javascript", ".wasm": "application/wasm", ".svg": "image/svg+xml"}
"""Spelled out: the system's table may say otherwise, and browsers run no script of another type."""


def first_page(folder: Path, base: str) -> str:
    """Return the first page with addresses below a base path, and the path for its scripts."""
    text = (folder / INDEX[1:]).read_text(encoding="utf-8")
    if not base:
        return text
    text = _ADDRESS.sub(rf'\1="{base}/', text)
    return text.replace("<head>", f'<head>\n    <meta name="{BASE_NAME}" content="{base}" />', 1)


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
POLICY: Final = "; ".join(f"{kind} {sources}" for kind, sources in _SOURCES.items())
"""Content that a page may load and run: its own files only, and no inline script."""
NOT_BUILT: Final = """<!doctype html>
<html lang="en"><meta charset="utf-8"><title>BuildArena</title>
<h1>BuildArena</h1>
<p>The service runs; its dashboard has not been built. <code>make web</code> builds it, and the
service shows it here after its next start.</p>
<p>Meanwhile: the API's <a href="{base}/docs">documentation</a> and the
<a href="{base}/v1/leaderboard">leaderboard as JSON</a>.</p>
</html>
"""


JOB: Final = re.compile(r"/jobs/(job_[0-9a-f]{1,40})")
"""Pages that a shared link shows with a title, a sentence and a picture."""
TITLE: Final = re.compile("<title>.*?</title>")
Preview = Callable[[str], tuple[str, str] | None]
"""Title and explanation of a job by its id; None for an unknown id."""

API: Final = re.compile(r"/(?:v1|docs|openapi\.json|static-offline-docs|assets)(?:/|$)")
"""Paths whose answers are always for programs."""


def is_page(path: str) -> bool:
    """Return whether a path is a page's; no route of the API has such a path."""
    return PAGE.fullmatch(path) is not None


class Dashboard:
    """An ASGI application for the paths that no route has.

    Args:
        otherwise: Handles requests for anything but a page.
        base: Path below which a proxy shows the service.
        preview: Preview of a link to a job, shown without a key; None for no preview.
    """

    def __init__(
        self,
        otherwise: ASGIApp,
        *,
        folder: Path = FOLDER,
        base: str = "",
        preview: Preview | None = None,
    ) -> None:
        self._otherwise, self._folder, self._base = otherwise, folder, base
        self._preview = preview

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer with a page or one of its files, or pass the request on."""
        response = self._find(scope) if scope["type"] == "http" else None
        if response is not None and response.status_code == HTTPStatus.OK:
            response = await self._with_preview(scope) or response
        await (response or self._otherwise)(scope, receive, send)

    async def _with_preview(self, scope: Scope) -> Response | None:
        """Return the page of a job with the tags that previews of links read."""
        page = JOB.fullmatch(scope["path"].removeprefix(scope.get("root_path", "")))
        if page is None or self._preview is None or not (self._folder / INDEX[1:]).is_file():
            return None
        preview = await run_in_threadpool(self._preview, page[1])
        if preview is None:
            return None
        url, (title, sentence) = URL(scope=scope), preview
        picture = f"{url.scheme}://{url.netloc}{self._base}/v1/jobs/{page[1]}/thumbnail.png"
        tags = {"title": title, "description": sentence, "image": picture, "type": "article"}
        head = "".join(
            f'<meta property="og:{name}" content="{escape(text)}" />' for name, text in tags.items()
        )
        title = f"<title>{escape(title)} · BuildArena</title>{head}"
        text = TITLE.sub(lambda _: title, first_page(self._folder, self._base), count=1)
        headers = {"Cache-Control": "no-cache", "Content-Security-Policy": POLICY}
        return HTMLResponse(text, headers=headers)

    def _find(self, scope: Scope) -> Response | None:
        path = scope["path"].removeprefix(scope.get("root_path", ""))
        if scope["method"] not in {"GET", "HEAD"}:
            return None
        headers = Headers(scope=scope)
        if is_page(path):
            return self._first_page(headers)
        if FILE.fullmatch(path) and path != INDEX and not path.endswith((*ENCODINGS.values(),)):
            response = self._file(path, headers)
            if response is not None:
                return response
        # The page that says so, for people: a browser opened the address itself.
        is_visit = headers.get("sec-fetch-dest") == "document" and not API.match(path)
        if not is_visit or not (self._folder / INDEX[1:]).is_file():
            return None
        answer = self._first_page(headers)
        answer.status_code = 404 if answer.status_code == HTTPStatus.OK else answer.status_code
        return answer

    def _first_page(self, headers: Headers) -> Response:
        if not (self._folder / INDEX[1:]).is_file():
            text = NOT_BUILT.format(base=self._base)
            return HTMLResponse(text, headers={"Content-Security-Policy": POLICY})
        if not self._base:
            return self._file(INDEX, headers) or Response(status_code=404)
        page = Answer.of(first_page(self._folder, self._base).encode())
        answer = {"ETag": page.etag, "Cache-Control": "no-cache", "Content-Security-Policy": POLICY}
        if has_tag(headers, page.etag):
            return Response(status_code=304, headers=answer)
        return HTMLResponse(page.body, headers=answer)

    def _file(self, path: str, headers: Headers) -> Response | None:
        file = self._folder / path[1:]
        if not file.is_file():
            return None
        kind = _TYPES.get(file.suffix) or mimetypes.guess_type(path)[0]
        is_hashed = path.startswith(HASHED)
        answer = {
            "Cache-Control": "public, max-age=31536000, immutable" if is_hashed else "no-cache",
            "Vary": "Accept-Encoding",
            "Content-Security-Policy": POLICY,
        }
        copies = [name for name, suffix in ENCODINGS.items() if Path(f"{file}{suffix}").is_file()]
        encoding = _choose_encoding(headers.get("accept-encoding", ""), copies)
        if encoding is not None:
            answer["Content-Encoding"] = encoding
            file = Path(f"{file}{ENCODINGS[encoding]}")
        # Each encoding is another file, so it has another tag.
        response = FileResponse(file, media_type=kind, headers=answer, stat_result=file.stat())
        if has_tag(headers, response.headers["etag"]):
            headers_kept = {name: response.headers[name] for name in (*answer, "ETag")}
            return Response(status_code=304, headers=headers_kept)
        return response


def _choose_encoding(accept: str, encoded: Iterable[str]) -> str | None:
    """Return the best available encoding that the client accepts."""
    weights: dict[str, float] = {}
    for entry in accept.split(","):
        name, _, quality = entry.partition(";")
        weight = re.fullmatch(r"\s*q\s*=\s*([01](?:\.[0-9]{0,3})?)\s*", quality)
        weights[name.strip().lower()] = 1.0 if weight is None else float(weight[1])
    return next((name for name in encoded if weights.get(name, 0.0) > 0), None)
