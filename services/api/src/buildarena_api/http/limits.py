"""What every request passes: a limit on its size, and headers that make browsers careful."""

from __future__ import annotations

import json
from collections.abc import Collection
from http import HTTPStatus

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from buildarena_api.http.problems import PROBLEM_JSON

MAX_BYTES = 4 * 1024 * 1024
"""Largest request body: a sweep of 100,000 seeds has less than a megabyte."""
SECURITY_HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
}


class BodyLimitMiddleware:
    """Middleware around the application.

    Args:
        app: The application.
        unlimited: Paths of routes that read their bodies in pieces, and bound them.
        max_bytes: Largest request body accepted.
    """

    def __init__(
        self, app: ASGIApp, *, unlimited: Collection[str] = (), max_bytes: int = MAX_BYTES
    ) -> None:
        self._app = app
        self._unlimited = frozenset(unlimited)
        self._max_bytes = max_bytes

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Passes a request on, or refuses it for its size."""
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
        body = await self._read(receive)
        if body is None:
            await self._refuse(safe_send)
            return
        await self._app(scope, _replay(body, receive), safe_send)

    async def _read(self, receive: Receive) -> bytes | None:
        """The whole body, or None when it is too large, whatever its length header says."""
        body = bytearray()
        while True:
            message = await receive()
            if message["type"] != "http.request":
                return bytes(body)
            body += message.get("body", b"")
            if len(body) > self._max_bytes:
                return None
            if not message.get("more_body", False):
                return bytes(body)

    async def _refuse(self, send: Send) -> None:
        status = HTTPStatus.REQUEST_ENTITY_TOO_LARGE
        problem: dict[str, object] = {
            "type": "about:blank",
            "title": status.phrase,
            "status": status.value,
            "detail": f"the request is larger than {self._max_bytes:,} bytes",
            "errors": [],
        }
        data = json.dumps(problem).encode()
        headers = [(b"content-type", PROBLEM_JSON.encode()), (b"connection", b"close")]
        await send({"type": "http.response.start", "status": status.value, "headers": headers})
        await send({"type": "http.response.body", "body": data})


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
