"""What every request passes: bounds on its body, and headers that make browsers careful."""

from __future__ import annotations

from collections.abc import Callable, Collection

import structlog
from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from buildarena_api.http.problems import send_problem
from buildarena_geometry.json_texts import MAX_DEPTH, is_too_deep

MAX_BYTES = 4 * 1024 * 1024
"""Largest request body: a sweep of 100,000 seeds has less than a megabyte."""
SECURITY_HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
}

log = structlog.get_logger(__name__)


class BodyLimitMiddleware:
    """Middleware around the application: only whole and bounded bodies reach it.

    Args:
        app: The application.
        unlimited: Paths of routes that read their bodies in pieces, and bound them.
        documents: Paths of routes that read something else than JSON, and bound its depth.
        pieces: Whether a path is one of a route that takes pieces of files.
        max_bytes: Largest request body accepted.
    """

    def __init__(
        self,
        app: ASGIApp,
        *,
        unlimited: Collection[str] = (),
        documents: Collection[str] = (),
        pieces: Callable[[str], bool] = lambda _: False,
        max_bytes: int = MAX_BYTES,
    ) -> None:
        self._app = app
        self._unlimited = frozenset(unlimited)
        self._documents = frozenset(documents)
        self._pieces = pieces
        self._max_bytes = max_bytes

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Passes a request on, refuses it for its size or depth, or drops one that was cut off."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        safe_send = _with_headers(send)
        if scope["path"] in self._unlimited:
            await self._app(scope, receive, safe_send)
            return
        length = Headers(scope=scope).get("content-length")
        if length is not None and length.isdigit() and int(length) > self._max_bytes:
            await self._refuse(safe_send)
            return
        try:
            body = await self._read(receive)
        except ConnectionError:
            log.info("body_cut_off", path=scope["path"])
            return
        if body is None:
            await self._refuse(safe_send)
        elif not self._is_no_json(scope["path"]) and is_too_deep(body):
            detail = f"the body has more than {MAX_DEPTH} arrays or objects inside each other"
            await send_problem(safe_send, 422, detail)
        else:
            await self._app(scope, _replay(body, receive), safe_send)

    def _is_no_json(self, path: str) -> bool:
        return path in self._documents or self._pieces(path)

    async def _read(self, receive: Receive) -> bytes | None:
        """The whole body, or None when it is too large, whatever its length header says.

        Raises:
            ConnectionError: The client left before the body's end.
        """
        body = bytearray()
        while True:
            message = await receive()
            if message["type"] != "http.request":
                raise ConnectionError("the client left")
            body += message.get("body", b"")
            if len(body) > self._max_bytes:
                return None
            if not message.get("more_body", False):
                return bytes(body)

    async def _refuse(self, send: Send) -> None:
        detail = f"the request is larger than {self._max_bytes:,} bytes"
        await send_problem(send, 413, detail, headers={"Connection": "close"})


def _with_headers(send: Send) -> Send:
    async def safe_send(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in SECURITY_HEADERS.items():
                headers.setdefault(name, value)
        await send(message)

    return safe_send


def _replay(body: bytes, receive: Receive) -> Receive:
    sent = False

    async def again() -> Message:
        nonlocal sent
        if not sent:
            sent = True
            return {"type": "http.request", "body": body, "more_body": False}
        return await receive()

    return again
