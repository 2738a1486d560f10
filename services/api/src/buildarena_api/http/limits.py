"""What every request passes: bounds on its body, and headers that make browsers careful."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Collection
from contextlib import suppress
from typing import Final

import structlog
from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from buildarena_api.http.admission import (
    Admit,
    BodyBuffers,
    BuffersFullError,
    PacedReceive,
    SlowBodyError,
    who_is,
)
from buildarena_api.http.problems import ProblemError, send_problem
from buildarena_geometry.json_texts import MAX_DEPTH, is_too_deep

MAX_BYTES = 4 * 1024 * 1024
"""Largest request body: a sweep of 100,000 seeds has less than a megabyte."""
DRAIN_BYTES: Final = 256 * 1024
DRAIN_S: Final = 0.5
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
        documents: Paths of routes that read something else than JSON, and bound its depth.
        pieces: Whether a path is one of a route that takes pieces of files.
        max_bytes: Largest request body accepted.
        most: The largest that some routes take, by path: None where it is `max_bytes`.
        admit: Refuses a request from its headers, before anything of its body is read.
        buffers: What bodies take of memory.
    """

    def __init__(
        self,
        app: ASGIApp,
        *,
        documents: Collection[str] = (),
        pieces: Callable[[str], bool] = lambda _: False,
        max_bytes: int = MAX_BYTES,
        most: Callable[[str], int | None] = lambda _: None,
        admit: Admit,
        buffers: BodyBuffers,
    ) -> None:
        self._app = app
        self._most, self._admit, self._buffers = most, admit, buffers
        self._documents = frozenset(documents)
        self._pieces = pieces
        self._max_bytes = max_bytes

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Passes a request on, refuses it for its size or depth, or drops one that was cut off."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        safe_send = _with_headers(send)
        headers, paced = Headers(scope=scope), PacedReceive(receive)
        if not _has_body(headers):
            await self._app(scope, receive, safe_send)
            return
        try:
            await self._admit(scope)
            await self._pass_whole(scope, headers, paced, safe_send)
        except ProblemError as error:
            await _drain(receive)
            closing = {**(error.headers or {}), "Connection": "close"}
            await send_problem(safe_send, error.status, error.detail, headers=closing)
        except SlowBodyError as error:
            log.info("body_too_slow", path=scope["path"])
            await send_problem(safe_send, 408, str(error), headers={"Connection": "close"})
        except ConnectionError:
            log.info("body_cut_off", path=scope["path"])

    async def _pass_whole(
        self, scope: Scope, headers: Headers, receive: Receive, send: Send
    ) -> None:
        path = scope["path"]
        most = self._most(path) or self._max_bytes
        length = headers.get("content-length")
        if length is not None and length.isdigit() and int(length) > most:
            raise _too_large(most)
        async with self._buffers.share(who_is(scope)) as take:
            try:
                body = await _read(receive, most, take)
            except BuffersFullError as error:
                raise _full(error) from error
            if not self._is_no_json(path) and is_too_deep(body):
                detail = f"the body has more than {MAX_DEPTH} arrays or objects inside each other"
                await send_problem(send, 422, detail)
            else:
                await self._app(scope, _replay(body, receive), send)

    def _is_no_json(self, path: str) -> bool:
        return path in self._documents or self._pieces(path)


def _has_body(headers: Headers) -> bool:
    return headers.get("content-length", "0") != "0" or "transfer-encoding" in headers


async def _read(receive: Receive, most: int, take: Callable[[int], None]) -> bytes:
    """The whole body.

    Raises:
        ProblemError: It is too large, whatever its length header says.
        ConnectionError: The client left before the body's end.
    """
    body = bytearray()
    while True:
        message = await receive()
        if message["type"] != "http.request":
            raise ConnectionError("the client left")
        piece = message.get("body", b"")
        if len(body) + len(piece) > most:
            raise _too_large(most)
        take(len(piece))
        body += piece
        if not message.get("more_body", False):
            return bytes(body)


async def _drain(receive: Receive) -> None:
    """Reads what is on its way of a refused body: a client that still sends sees no answer."""
    drained = 0
    with suppress(TimeoutError):
        async with asyncio.timeout(DRAIN_S):
            while drained < DRAIN_BYTES:
                message = await receive()
                drained += len(message.get("body", b""))
                if not message.get("more_body", False):
                    return


def _too_large(most: int) -> ProblemError:
    return ProblemError(413, f"the request is larger than {most:,} bytes")


def _full(error: BuffersFullError) -> ProblemError:
    if error.is_of_the_caller:
        detail = "your requests hold as much memory as one caller's may: send fewer at once"
        return ProblemError(429, detail, headers={"Retry-After": "1"})
    detail = "the service holds as many bytes of requests as it may"
    return ProblemError(503, detail, headers={"Retry-After": "2"})


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
