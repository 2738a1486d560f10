"""Requests that are repeated where they may be: the base of all endpoints."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import AsyncGenerator, Mapping
from pathlib import Path
from typing import Any, BinaryIO, Final

from buildarena_client.config import checked_key, checked_url, stored_key
from buildarena_client.errors import RefusedError, TimedOutError, UnreachableError
from buildarena_client.event_streams import MEDIA_TYPE, Event, event_of
from buildarena_client.files import WholeFile
from buildarena_client.problems import document, next_cursor, require_success
from buildarena_client.requests import JSON, Request, Response, json_body
from buildarena_client.retries import RestartWatch, Retries, RetryPolicy
from buildarena_client.transport_errors import BrokenError, SilentError, TransportError
from buildarena_client.transports import Answer, OpenTransport

TIMEOUT_S: Final = 60.0
STREAM_TIMEOUT_S: Final = 60.0
"""How long a stream of events may be silent: the service sends something every fifteen seconds."""
RESTART_POLL_S: Final = 0.5


class Sender:
    """Sends requests to one service, with the arguments of ``AsyncClient`` through a transport."""

    def __init__(
        self,
        url: str | None,
        key: str | None,
        *,
        timeout_s: float | None,
        retries: RetryPolicy,
        transport: OpenTransport,
    ) -> None:
        self.url = checked_url(url)
        self._key = checked_key(key or stored_key())
        self._timeout_s = timeout_s
        self._retries = retries
        headers = {"Authorization": f"Bearer {self._key}"} if self._key else {}
        self._transport = transport(self.url, headers)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.url!r})"

    async def close(self) -> None:
        """Closes connections that are kept."""
        await self._transport.close()

    async def get(self, /, path: str, **params: Any) -> Any:
        """The JSON answer to a GET; parameters that are None are left out."""
        return await self._document(self._request("GET", path, params))

    async def get_bytes(self, /, path: str, *, accept: str | None = None, **params: Any) -> bytes:
        """The bytes of a GET; parameters that are None are left out.

        Args:
            path: What is asked for.
            accept: Media type that is wanted, where there are several.
            params: Parameters of the request.
        """
        headers = {"Accept": accept} if accept else {}
        return (await self._answer(self._request("GET", path, params, headers=headers))).body

    async def post(
        self,
        /,
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
        data = json_body({} if body is None else body)
        headers = {"Content-Type": JSON, **(headers or {})}
        return await self._document(
            self._request("POST", path, params, body=data, headers=headers, repeatable=repeatable)
        )

    async def put(self, path: str, body: object) -> Any:
        """The JSON answer to a PUT."""
        headers = {"Content-Type": JSON}
        return await self._document(
            self._request("PUT", path, {}, body=json_body(body), headers=headers, repeatable=False)
        )

    async def upload(
        self,
        /,
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
            request = Request(
                method="POST",
                path=path,
                params=params,
                body=body,
                headers={"Content-Type": media_type, "Content-Length": str(size)},
                repeatable=repeatable,
            )
            return await self._document(request)

    async def download(
        self, /, path: str, target: Path, *, sha256: str | None = None, **params: Any
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
        async with self._opened(request) as answer:
            with WholeFile(target, sha256) as file:
                async for chunk in answer.chunks():
                    file.write(chunk)

    async def pages(
        self, /, path: str, *, cursor: str | None = None, **params: Any
    ) -> AsyncGenerator[Any, None]:
        """The answer to a GET of a list, and those of the pages behind it.

        Args:
            path: The list's.
            cursor: Where to begin; the first page by default.
            params: Further parameters; those that are None are left out.
        """
        while True:
            page = await self.get(path, cursor=cursor, **params)
            cursor = next_cursor(page, self.url)
            yield page
            if cursor is None:
                return

    async def get_patiently(self, path: str) -> Any:
        """As get, but waits while the service does not answer: it may be restarted."""
        watch = RestartWatch(self._retries)
        while True:
            try:
                return await self.get(path)
            except UnreachableError:
                if watch.gives_up(now=time.monotonic()):
                    raise
            await self._transport.pause(RESTART_POLL_S)

    async def _listed(
        self, path: str, name: str, limit: int | None, page: int, params: Mapping[str, Any]
    ) -> AsyncGenerator[Any, None]:
        """The documents of a list, page after page as they are needed.

        Args:
            path: The list's.
            name: Under which each page has its documents.
            limit: How many at most; None for all.
            page: How many are asked for at once.
            params: Further parameters.
        """
        remaining = float("inf") if limit is None else limit
        if remaining <= 0:
            return
        async for answer in self.pages(path, limit=min(page, remaining), **params):
            for listed in answer[name]:
                yield listed
                remaining -= 1
                if remaining <= 0:
                    return

    async def _events(self, path: str, after: int) -> AsyncGenerator[Event, None]:
        """Events as they happen, over as many connections as it takes."""
        watch = RestartWatch(self._retries)
        while True:
            request = Request(
                method="GET",
                path=path,
                headers={"Accept": MEDIA_TYPE, "Last-Event-ID": str(after)},
                repeatable=True,
                timeout_s=STREAM_TIMEOUT_S,
            )
            failure = UnreachableError(f"{self.url} ends its streams at once")
            try:
                async with (
                    self._opened(request) as answer,
                    contextlib.aclosing(answer.messages()) as messages,
                ):
                    try:
                        async for message in messages:
                            event = event_of(message)
                            after = event["id"]
                            yield event
                    finally:
                        if answer.has_begun:
                            watch.answered()
            except UnreachableError as error:
                failure = error
            if watch.gives_up(now=time.monotonic()):
                raise failure
            await self._transport.pause(RESTART_POLL_S)

    def _request(
        self,
        method: str,
        path: str,
        params: Mapping[str, Any],
        *,
        body: bytes | None = None,
        headers: Mapping[str, str] | None = None,
        repeatable: bool = True,
    ) -> Request:
        return Request(
            method=method,
            path=path,
            params=params,
            body=body,
            headers=headers or {},
            repeatable=repeatable,
            timeout_s=self._timeout_s,
        )

    async def _document(self, request: Request) -> Any:
        return document(await self._answer(request))

    async def _answer(self, request: Request) -> Response:
        retries = Retries(request, self._retries, now=time.monotonic())
        while True:
            try:
                response = await self._transport.send(request)
                pause_s = retries.pause_after(response, now=time.monotonic())
            except TransportError as error:
                pause_s = retries.pause_after_break() if isinstance(error, BrokenError) else None
                if pause_s is None:
                    raise self._unreachable(error) from error
            else:
                if pause_s is None:
                    return require_success(request, response, key=self._key)
            await self._transport.pause(pause_s)
            request.rewind()

    @contextlib.asynccontextmanager
    async def _opened(self, request: Request) -> AsyncGenerator[Answer, None]:
        """An answer to be read on, whose reading is all of it or an error; retries come before."""
        retries = Retries(request, self._retries, now=time.monotonic())
        while True:
            try:
                async with self._transport.opened(request) as answer:
                    if 200 <= answer.status < 300:  # noqa: PLR2004 - HTTP's classes
                        yield answer
                        return
                    response = await answer.read()
            except TransportError as error:
                raise self._unreachable(error) from error
            pause_s = retries.pause_after(response, now=time.monotonic())
            if pause_s is None:
                require_success(request, response, key=self._key)
                raise RefusedError(response.status, f"HTTP {response.status} from {response.url}")
            await self._transport.pause(pause_s)

    def _unreachable(self, error: Exception) -> UnreachableError:
        kind = TimedOutError if isinstance(error, SilentError) else UnreachableError
        # Untrusted input: one line, and nothing that a terminal would obey.
        text = "".join(char if char.isprintable() else " " for char in str(error)).strip()
        return kind(f"no BuildArena answers at {self.url} ({text})")
