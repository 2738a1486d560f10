"""Requests with patience: what all methods of the client are made of.

Generated from the synchronous module: `make openapi` writes this file.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import time
from collections.abc import AsyncGenerator, AsyncIterator
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, Final, Self

from buildarena_client.errors import RefusedError, TimedOutError, UnreachableError
from buildarena_client.event_streams import Event, EventReader
from buildarena_client.files import WholeFile
from buildarena_client.patience import BREAK_PAUSE_S, Patience, Restarting, Waiting
from buildarena_client.places import checked_key, checked_url, kept_key
from buildarena_client.problems import document, require_success
from buildarena_client.requests import JSON, Request, Response, json_body

TIMEOUT_S: Final = 60.0
STREAM_TIMEOUT_S: Final = 60.0
"""How long a stream of events may be silent: the service sends something every fifteen seconds."""
RESTART_POLL_S: Final = 0.5
AT_ONCE: Final = 16
"""Of one caller, the service has 96 requests open at most."""


class AsyncSender:
    """Sends requests to one service.

    Args:
        url: Where it is, for example ``http://127.0.0.1:8321``; by default BUILDARENA_URL.
        key: The API key; by default the one in BUILDARENA_KEY, or in the file that
            BUILDARENA_KEY_FILE names, if any.
        timeout_s: How long nothing may come before a request is given up.
        patience: How long requests are sent again.
        at_once: Requests that are open at most; further ones wait. Downloads and
            streams are not counted.

    Attributes:
        url: Where the service is.

    Raises:
        BadArgumentError: That is not the URL of an API, or not a key.
    """

    def __init__(
        self,
        url: str | None = None,
        key: str | None = None,
        *,
        timeout_s: float | None = TIMEOUT_S,
        patience: Patience | None = None,
        at_once: int = AT_ONCE,
    ) -> None:
        # Help and completion of the command line load this module, and send nothing by it.
        from buildarena_client.asynchronous.wire import AsyncWire
        from buildarena_client.faults import BrokenError, SilentError, WireError

        self.url = checked_url(url)
        self._key = checked_key(key or kept_key())
        self._timeout_s = timeout_s
        self._patience = patience or Patience()
        self._broken, self._silent, self._failed = BrokenError, SilentError, WireError
        headers = {"Authorization": f"Bearer {self._key}"} if self._key else {}
        self._wire = AsyncWire(self.url, headers, at_once=at_once)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.url!r})"

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        await self.close()

    async def close(self) -> None:
        """Ends what is open."""
        await self._wire.close()

    async def get(self, path: str, **params: Any) -> Any:
        """The JSON answer to a GET; parameters that are None are left out."""
        return await self._document(self._reading(path, params))

    async def get_bytes(self, path: str, *, accept: str | None = None, **params: Any) -> bytes:
        """The bytes of a GET; parameters that are None are left out.

        Args:
            path: What is asked for.
            accept: Media type that is wanted, where there are several.
            params: Parameters of the request.
        """
        response = await self._answer(self._reading(path, params, accept=accept))
        return response.body

    async def post(
        self,
        path: str,
        body: object = None,
        *,
        repeatable: bool = False,
        headers: dict[str, str] | None = None,
        **params: Any,
    ) -> Any:
        """The JSON answer to a POST.

        Args:
            path: Where to.
            body: A document; None for an empty one.
            repeatable: Whether it may be sent again though it may have been carried out.
            headers: Further headers.
            params: Parameters of the request; those that are None are left out.
        """
        return await self._document(
            Request(
                method="POST",
                path=path,
                params=params,
                body=json_body({} if body is None else body),
                headers={"Content-Type": JSON, **(headers or {})},
                repeatable=repeatable,
                timeout_s=self._timeout_s,
            )
        )

    async def put(self, path: str, body: object) -> Any:
        """The JSON answer to a PUT."""
        return await self._document(
            Request(
                method="PUT",
                path=path,
                body=json_body(body),
                headers={"Content-Type": JSON},
                timeout_s=self._timeout_s,
            )
        )

    async def upload(
        self,
        path: str,
        source: Path | bytes,
        media_type: str,
        *,
        repeatable: bool = False,
        **params: Any,
    ) -> Any:
        """The JSON answer to a POST of a file.

        Args:
            path: Where to.
            source: The file, or its bytes.
            media_type: What it is.
            repeatable: Whether it may be sent again though it may have been carried out.
            params: Parameters of the request; those that are None are left out.
        """
        with contextlib.ExitStack() as stack:
            body: bytes | BinaryIO
            if isinstance(source, bytes):
                body, size = source, len(source)
            else:
                body = stack.enter_context(source.open("rb"))
                size = os.fstat(body.fileno()).st_size
            return await self._document(
                Request(
                    method="POST",
                    path=path,
                    params=params,
                    body=body,
                    headers={"Content-Type": media_type, "Content-Length": str(size)},
                    repeatable=repeatable,
                )
            )

    async def download(
        self, path: str, target: Path, *, sha256: str | None = None, **params: Any
    ) -> None:
        """Writes the answer to a GET into a file, which is there whole or not at all.

        Args:
            path: What is asked for.
            target: The file.
            sha256: The hash that its bytes must have, if it is known.
            params: Parameters of the request; those that are None are left out.

        Raises:
            DamagedError: Its bytes have another hash.
        """
        request = Request(method="GET", path=path, params=params, repeatable=True)
        async with contextlib.aclosing(self._chunks(request)) as chunks:
            with WholeFile(target, sha256) as file:
                async for chunk in chunks:
                    file.write(chunk)

    async def pages(
        self, path: str, *, cursor: str | None = None, **params: Any
    ) -> AsyncIterator[Any]:
        """The answer to a GET of a list, and those of the pages behind it.

        Args:
            path: The list's.
            cursor: Where to begin; the first page by default.
            params: Further parameters; those that are None are left out.
        """
        while True:
            page = await self.get(path, cursor=cursor, **params)
            yield page
            cursor = page["next_cursor"]
            if cursor is None:
                return

    async def get_patiently(self, path: str) -> Any:
        """As get, but waits while the service does not answer: it may be restarted."""
        restarting = Restarting(self._patience)
        while True:
            try:
                return await self.get(path)
            except UnreachableError:
                if restarting.gives_up(now=time.monotonic()):
                    raise
            await asyncio.sleep(RESTART_POLL_S)

    async def _events(self, path: str, after: int) -> AsyncGenerator[Event, None]:
        """Events as they happen, over as many connections as it takes."""
        restarting = Restarting(self._patience)
        while True:
            request = Request(
                method="GET",
                path=path,
                headers={"Accept": "text/event-stream", "Last-Event-ID": str(after)},
                repeatable=True,
                timeout_s=STREAM_TIMEOUT_S,
            )
            reader = EventReader()
            try:
                async with contextlib.aclosing(self._chunks(request)) as chunks:
                    async for chunk in chunks:
                        restarting.answered()
                        for event in reader.feed(chunk):
                            after = event["id"]
                            yield event
            except UnreachableError:
                if restarting.gives_up(now=time.monotonic()):
                    raise
            await asyncio.sleep(BREAK_PAUSE_S)

    def _reading(self, path: str, params: dict[str, Any], *, accept: str | None = None) -> Request:
        return Request(
            method="GET",
            path=path,
            params=params,
            headers={"Accept": accept} if accept else {},
            repeatable=True,
            timeout_s=self._timeout_s,
        )

    async def _document(self, request: Request) -> Any:
        response = await self._answer(request)
        return document(response)

    async def _answer(self, request: Request) -> Response:
        waiting = Waiting(request, self._patience, now=time.monotonic())
        while True:
            try:
                response = await self._wire.send(request)
                pause_s = waiting.pause_after(response, now=time.monotonic())
            except self._failed as error:
                pause_s = waiting.pause_after_break() if isinstance(error, self._broken) else None
                if pause_s is None:
                    raise self._unreachable(error) from error
            else:
                if pause_s is None:
                    return require_success(request, response, key=self._key)
            await asyncio.sleep(pause_s)
            request.rewind()

    async def _chunks(self, request: Request) -> AsyncGenerator[bytes, None]:
        """The pieces of an answer, all of them or an error; patient before the first."""
        waiting = Waiting(request, self._patience, now=time.monotonic())
        while True:
            try:
                async with self._wire.opened(request) as answer:
                    if 200 <= answer.status < 300:  # noqa: PLR2004 - HTTP's classes
                        async for chunk in answer.chunks():
                            yield chunk
                        return
                    response = await answer.read()
            except self._failed as error:
                raise self._unreachable(error) from error
            pause_s = waiting.pause_after(response, now=time.monotonic())
            if pause_s is None:
                require_success(request, response, key=self._key)
                raise RefusedError(response.status, f"HTTP {response.status} from {response.url}")
            await asyncio.sleep(pause_s)

    def _unreachable(self, error: Exception) -> UnreachableError:
        kind = TimedOutError if isinstance(error, self._silent) else UnreachableError
        # A stranger's words: one line, and nothing that a terminal would obey.
        words = "".join(one if one.isprintable() else " " for one in str(error)).strip()
        return kind(f"no BuildArena answers at {self.url} ({words})")
