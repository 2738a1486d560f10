"""Bounds on request bodies."""

from __future__ import annotations

import asyncio
import hashlib
import json
import re
from collections.abc import Awaitable, Callable, Collection
from contextlib import AbstractAsyncContextManager, nullcontext, suppress
from typing import IO, Final

import structlog
from anyio import to_thread
from starlette.datastructures import Headers
from starlette.requests import ClientDisconnect, Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from buildarena_api.http.places import Places
from buildarena_api.http.problems import ErrorCode, ProblemError
from buildarena_backend.database.text import clean
from buildarena_benchmark import SourceError, ValidationIssue
from buildarena_benchmark.tasks.sources import parse_source
from buildarena_geometry.json_texts import MAX_DEPTH, is_too_deep

MAX_BYTES = 4 * 1024 * 1024
"""Largest request body: a sweep of 100,000 seeds has less than a megabyte."""
SMALL_BYTES: Final = 64 * 1024
"""Size above which a body takes a place until it is answered."""
BODY_S: Final = 120.0
"""Limit for the arrival of a body."""
FILE_S: Final = 600.0
"""Limit for the arrival of an uploaded file."""
DRAIN_BYTES: Final = 256 * 1024
DRAIN_S: Final = 0.5
YAML: Final = "application/yaml"
YAML_TYPES: Final = frozenset({YAML, "application/x-yaml", "text/yaml", "text/x-yaml"})
_ESCAPED: Final = re.compile(rb"\\u(?:0000|[dD][89a-fA-F])")
"""Escapes in JSON texts that cannot be stored: NUL, and halves of characters."""
_OF_BODY: Final = (b"content-type", b"content-length", b"transfer-encoding")
Admit = Callable[[Scope], Awaitable[str]]
"""Names a request's sender from its headers alone; raises `ProblemError` if it is refused."""

log = structlog.get_logger(__name__)


class BodyLimitMiddleware:
    """Middleware around the application: only whole and bounded bodies reach it.

    Args:
        documents: Paths of routes that read something else than JSON, and bound its depth.
        is_upload: Whether a path is one of a route that reads the body itself, with `receive_file`.
        limit_of: Largest body by path; None for `MAX_BYTES`.
        admit: Refuses a request from its headers, before anything of its body is read.
        places: For large bodies.
    """

    def __init__(
        self,
        app: ASGIApp,
        *,
        documents: Collection[str],
        is_upload: Callable[[str], bool],
        limit_of: Callable[[str], int | None],
        admit: Admit,
        places: Places,
    ) -> None:
        self._app = app
        self._most, self._admit, self._places = limit_of, admit, places
        self._documents, self._is_upload = documents, is_upload

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, refuse it for its size or depth, or drop one that was cut off."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        if not _has_body(headers):
            await self._app(scope, receive, send)
            return
        try:
            caller = await self._admit(scope)
            async with self._place(scope["path"], caller, headers):
                await self._pass_whole(scope, headers, receive, send)
        except ProblemError as error:
            await _drain(receive)
            error.headers["Connection"] = "close"
            await error.answer()(scope, receive, send)
        except ConnectionError:
            log.info("body_cut_off", path=scope["path"])

    def _place(self, path: str, caller: str, headers: Headers) -> AbstractAsyncContextManager[None]:
        length = headers.get("content-length", "")
        is_small = length.isdigit() and int(length) <= SMALL_BYTES
        return nullcontext() if is_small or self._is_upload(path) else self._places.of(caller)

    async def _pass_whole(
        self, scope: Scope, headers: Headers, receive: Receive, send: Send
    ) -> None:
        path = scope["path"]
        limit = self._most(path) or MAX_BYTES
        length = headers.get("content-length")
        if length is not None and length.isdigit() and int(length) > limit:
            raise _too_large(limit)
        if self._is_upload(path):
            await self._app(scope, receive, send)
            return
        try:
            async with asyncio.timeout(BODY_S):
                body = await _read(receive, limit)
        except TimeoutError as error:
            raise ProblemError(
                ErrorCode.BODY_TIMEOUT, f"the body did not come within {BODY_S:g} s"
            ) from error
        try:
            if path not in self._documents:
                scope, body = await _as_json(scope, headers, body)
        except ProblemError as error:
            await error.answer()(scope, receive, send)
        else:
            await self._app(scope, _replay(body, receive), send)


async def _as_json(scope: Scope, headers: Headers, body: bytes) -> tuple[Scope, bytes]:
    """Return a request whose body is JSON of bounded depth, in the place of one in YAML too.

    Raises:
        ProblemError: It is nested too deeply, or no YAML.
    """
    if is_yaml(headers):
        try:
            text = body.decode()
            source = await to_thread.run_sync(lambda: parse_source(text, origin="body"))
        except UnicodeDecodeError as error:
            raise not_utf8(body, error) from error
        except SourceError as error:
            raise ProblemError(ErrorCode.INVALID_YAML, str(error), errors=error.issues) from error
        body = json.dumps(source.content, default=str).encode()
        headers_kept = [header for header in scope["headers"] if header[0] not in _OF_BODY]
        own = [
            (b"content-type", b"application/json"),
            (b"content-length", str(len(body)).encode()),
        ]
        scope = {**scope, "headers": [*headers_kept, *own]}
    if is_too_deep(body):
        detail = f"the body has more than {MAX_DEPTH} arrays or objects inside each other"
        raise ProblemError(ErrorCode.TOO_DEEP, detail)
    if _ESCAPED.search(body):
        # The route refuses anything but JSON.
        with suppress(ValueError):
            body = json.dumps(clean(json.loads(body))).encode()
    return scope, body


def is_yaml(headers: Headers) -> bool:
    """Return whether a request declares its body as YAML."""
    return headers.get("content-type", "").partition(";")[0].strip().lower() in YAML_TYPES


def not_utf8(body: bytes, error: UnicodeDecodeError) -> ProblemError:
    """Return the problem of a text that is not UTF-8."""
    line = body.count(b"\n", 0, error.start) + 1
    message = "the text is not UTF-8"
    issue = ValidationIssue(path="", message=message, line=line)
    return ProblemError(ErrorCode.INVALID_YAML, f"line {line}: {message}", errors=[issue])


def _has_body(headers: Headers) -> bool:
    return headers.get("content-length", "0") != "0" or "transfer-encoding" in headers


async def _read(receive: Receive, limit: int) -> bytes:
    """Return the whole body.

    Raises:
        ProblemError: It is too large, even if its length header is not.
        ConnectionError: The client left before the body's end.
    """
    body = bytearray()
    while True:
        message = await receive()
        if message["type"] != "http.request":
            raise ConnectionError("the client left")
        piece = message.get("body", b"")
        if len(body) + len(piece) > limit:
            raise _too_large(limit)
        body += piece
        if not message.get("more_body", False):
            return bytes(body)


async def receive_file(request: Request, file: IO[bytes], *, max_bytes: int) -> str:
    """Write a request's body to a file while receiving it, and return its SHA-256.

    Raises:
        ProblemError: It is too large, takes longer than `FILE_S`, or is cut off.
    """
    digest, size = hashlib.sha256(), 0
    try:
        async with asyncio.timeout(FILE_S):
            async for part in request.stream():
                size += len(part)
                if size > max_bytes:
                    raise _too_large(max_bytes)
                digest.update(part)
                file.write(part)
    except TimeoutError as error:
        raise ProblemError(
            ErrorCode.BODY_TIMEOUT, f"the file did not come within {FILE_S:g} s"
        ) from error
    except ClientDisconnect as error:
        raise ProblemError(ErrorCode.BROKEN_BODY, "the file was cut off") from error
    return digest.hexdigest()


async def _drain(receive: Receive) -> None:
    """Read the rest of a refused body: a client that still sends sees no answer."""
    drained = 0
    with suppress(TimeoutError):
        async with asyncio.timeout(DRAIN_S):
            while drained < DRAIN_BYTES:
                message = await receive()
                drained += len(message.get("body", b""))
                if not message.get("more_body", False):
                    return


def _too_large(limit: int) -> ProblemError:
    return ProblemError(ErrorCode.TOO_LARGE, f"the request is larger than {limit:,} bytes")


def _replay(body: bytes, receive: Receive) -> Receive:
    sent = False

    async def again() -> Message:
        nonlocal sent
        if not sent:
            sent = True
            return {"type": "http.request", "body": body, "more_body": False}
        return await receive()

    return again
