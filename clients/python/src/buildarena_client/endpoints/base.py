"""The kinds of requests that all endpoints are made of."""

from __future__ import annotations

import time
from collections.abc import AsyncGenerator, Callable, Mapping
from pathlib import Path
from typing import Any, Final

from buildarena_client.config import checked_key, checked_url, stored_key
from buildarena_client.errors import NotAnApiError, TimedOutError, UnreachableError
from buildarena_client.event_streams import MAX_EVENT_BYTES, MEDIA_TYPE, Event, event_of
from buildarena_client.files import whole_file
from buildarena_client.retries import RetryPolicy

TIMEOUT_S: Final = 60.0
PAGE: Final = 200
"""Rows per request, the service's maximum."""
AT_ONCE: Final = 16
"""Concurrent requests; the service allows 96 per caller."""
STREAM_TIMEOUT_S: Final = 60.0
"""Maximum silence of an event stream: the service sends something every fifteen seconds."""
RESTART_POLL_S: Final = 0.5
POLL_S: Final = 0.5
"""Polling interval, seconds."""


class Sender:
    """Sender of requests to one service, with the arguments of ``AsyncClient``.

    If ``at_once`` is None, its coroutines block, see ``transport.Transport``.
    """

    def __init__(
        self,
        url: str | None = None,
        key: str | None = None,
        *,
        timeout_s: float | None = TIMEOUT_S,
        retries: RetryPolicy | None = None,
        at_once: int | None = AT_ONCE,
    ) -> None:
        # Help and completion of the command line load this module, and send nothing by it.
        from buildarena_client.transport import Transport

        self.url = checked_url(url)
        self._retries = retries or RetryPolicy()
        self._transport = Transport(
            self.url,
            checked_key(key or stored_key()),
            timeout_s=timeout_s,
            retries=self._retries,
            at_once=at_once,
        )

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.url!r})"

    async def close(self) -> None:
        """Close kept-alive connections."""
        await self._transport.close()

    async def get(self, /, path: str, **params: Any) -> Any:
        """Return the JSON response to a GET; parameters that are None are left out."""
        return await self._document("GET", path, params)

    async def get_bytes(self, /, path: str, *, accept: str | None = None, **params: Any) -> bytes:
        """Return the response body of a GET; parameters that are None are left out.

        Args:
            path: Path below the service's URL.
            accept: Requested media type, if there are several.
            params: Query parameters.
        """
        headers = {"Accept": accept} if accept else None
        return (await self._transport.answer("GET", path, params, headers=headers)).content

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
        """Return the JSON response to a POST.

        Args:
            path: Path below the service's URL.
            body: Document; None for an empty one.
            repeatable: True if it may be sent again although it may have been executed.
            headers: Further headers.
            params: Query parameters; those that are None are left out.
        """
        json = {} if body is None else body
        return await self._document(
            "POST", path, params, json=json, headers=headers, repeatable=repeatable
        )

    async def put(self, path: str, body: object) -> Any:
        """Return the JSON response to a PUT."""
        return await self._document("PUT", path, {}, json=body, repeatable=False)

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
        """Return the JSON response to a POST of a file.

        Args:
            path: Path below the service's URL.
            source: File, or its bytes.
            repeatable: True if it may be sent again although it may have been executed.
            params: Query parameters; those that are None are left out.
        """
        content = source if isinstance(source, bytes) else source.read_bytes()  # noqa: ASYNC240 - it is small
        headers = {"Content-Type": media_type}
        return await self._document(
            "POST", path, params, content=content, headers=headers, repeatable=repeatable
        )

    async def download(
        self, /, path: str, target: Path, *, sha256: str | None = None, **params: Any
    ) -> None:
        """Write the response to a GET into a file, which is complete or absent.

        Args:
            path: Path below the service's URL.
            sha256: Expected hash of its bytes, if known.
            params: Query parameters; those that are None are left out.

        Raises:
            DamagedError: Its hash differs.
        """
        async with self._transport.opened(path, params) as answer:
            with whole_file(target, sha256) as file:
                async for chunk in answer.aiter_raw():
                    file.write(chunk)

    async def pages(
        self, /, path: str, *, cursor: str | None = None, **params: Any
    ) -> AsyncGenerator[Any, None]:
        """Yield the response to a GET of a list, and the following pages.

        Args:
            path: Path of the list.
            cursor: Cursor to begin at. Defaults to the first page.
            params: Further parameters; those that are None are left out.
        """
        while True:
            page = await self.get(path, cursor=cursor, **params)
            if not isinstance(page, dict) or not isinstance(page.get("next_cursor", 0), str | None):
                raise NotAnApiError(
                    f"{self.url} is not BuildArena: a page of a list lacks its next_cursor"
                )
            cursor = page["next_cursor"]
            yield page
            if cursor is None:
                return

    async def get_patiently(self, path: str) -> Any:
        """Send a GET, and wait while the service does not answer, for example during a restart."""
        until: float | None = None
        while True:
            try:
                return await self.get(path)
            except UnreachableError:
                until = until or time.monotonic() + self._retries.restart_s
                if time.monotonic() > until:
                    raise
            await self._transport.pause(RESTART_POLL_S)

    async def every(self, /, path: str, **params: Any) -> list[Any]:
        """Return all rows of a list; parameters that are None are left out."""
        return [row async for row in self._listed(path, None, PAGE, params)]

    async def _listed(
        self, path: str, limit: int | None, page: int, params: Mapping[str, Any]
    ) -> AsyncGenerator[Any, None]:
        """Yield the rows of a list, page after page as needed."""
        remaining = float("inf") if limit is None else limit
        if remaining <= 0:
            return
        async for answer in self.pages(path, limit=min(page, remaining), **params):
            for listed in answer["data"]:
                yield listed
                remaining -= 1
                if remaining <= 0:
                    return

    async def _events(self, path: str, after: int) -> AsyncGenerator[Event, None]:
        """Yield the events as they happen, over as many connections as it takes."""
        from httpx2 import EventSource

        until: float | None = None
        while True:
            headers = {"Accept": MEDIA_TYPE, "Last-Event-ID": str(after)}
            stream = self._transport.opened(path, {}, headers=headers, timeout=STREAM_TIMEOUT_S)
            failure = UnreachableError(f"{self.url} ends its streams at once")
            try:
                async with stream as answer:
                    try:
                        async for message in EventSource(answer, MAX_EVENT_BYTES):
                            if message.data:
                                event = event_of(message)
                                after = event["id"]
                                yield event
                    finally:
                        if answer.num_bytes_downloaded:
                            until = None
            except UnreachableError as error:
                failure = error
            until = until or time.monotonic() + self._retries.restart_s
            if time.monotonic() > until:
                raise failure
            await self._transport.pause(RESTART_POLL_S)

    async def _when(
        self,
        path: str,
        ended: Callable[[Any], bool],
        timeout_s: float | None,
        *,
        poll_s: float = POLL_S,
        progress: Callable[[Any], object] | None = None,
    ) -> Any:
        """Poll a document until it has ended, and report each response to ``progress``.

        Raises:
            TimedOutError: It has not ended within the time.
        """
        started = time.monotonic()
        while True:
            document = await self.get_patiently(path)
            if progress is not None:
                progress(document)
            if ended(document):
                return document
            if timeout_s is not None and time.monotonic() - started > timeout_s:
                raise TimedOutError(f"{document['id']} has not ended within {timeout_s:g} s")
            await self._transport.pause(poll_s)

    async def _document(
        self, method: str, path: str, params: Mapping[str, Any], **more: Any
    ) -> Any:
        answer = await self._transport.answer(method, path, params, **more)
        try:
            return answer.json()
        except (ValueError, RecursionError) as error:
            message = f"{answer.url} is not BuildArena: it does not answer in JSON"
            raise NotAnApiError(message) from error
