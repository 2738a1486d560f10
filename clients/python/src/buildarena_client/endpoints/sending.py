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
"""Rows that are asked for at once, as many as the service gives."""
AT_ONCE: Final = 16
"""Of one caller, the service has 96 requests open at most."""
STREAM_TIMEOUT_S: Final = 60.0
"""How long a stream of events may be silent: the service sends something every fifteen seconds."""
RESTART_POLL_S: Final = 0.5
POLL_S: Final = 0.5
"""Seconds between two looks at what is waited for."""


class Sender:
    """Sends requests to one service, with the arguments of ``AsyncClient``.

    Where ``at_once`` is None, its coroutines block, as ``transport.Transport`` says.
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
        """Closes connections that are kept."""
        await self._transport.close()

    async def get(self, /, path: str, **params: Any) -> Any:
        """The JSON answer to a GET; parameters that are None are left out."""
        return await self._document("GET", path, params)

    async def get_bytes(self, /, path: str, *, accept: str | None = None, **params: Any) -> bytes:
        """The bytes of a GET; parameters that are None are left out.

        Args:
            path: What is asked for.
            accept: Media type that is wanted, where there are several.
            params: Parameters of the request.
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
        """The JSON answer to a POST.

        Args:
            path: Where to.
            body: A document; None for an empty one.
            repeatable: Whether it may be sent again though it may have been carried out.
            headers: Further headers.
            params: Parameters of the request; those that are None are left out.
        """
        json = {} if body is None else body
        return await self._document(
            "POST", path, params, json=json, headers=headers, repeatable=repeatable
        )

    async def put(self, path: str, body: object) -> Any:
        """The JSON answer to a PUT."""
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
        """The JSON answer to a POST of a file.

        Args:
            path: Where to.
            source: The file, or its bytes.
            media_type: What it is.
            repeatable: Whether it may be sent again though it may have been carried out.
            params: Parameters of the request; those that are None are left out.
        """
        content = source if isinstance(source, bytes) else source.read_bytes()  # noqa: ASYNC240 - it is small
        headers = {"Content-Type": media_type}
        return await self._document(
            "POST", path, params, content=content, headers=headers, repeatable=repeatable
        )

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
        async with self._transport.opened(path, params) as answer:
            with whole_file(target, sha256) as file:
                async for chunk in answer.aiter_raw():
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
            if not isinstance(page, dict) or not isinstance(page.get("next_cursor", 0), str | None):
                raise NotAnApiError(
                    f"{self.url} is not BuildArena: a page of a list lacks its next_cursor"
                )
            cursor = page["next_cursor"]
            yield page
            if cursor is None:
                return

    async def get_patiently(self, path: str) -> Any:
        """As get, but waits while the service does not answer: it may be restarted."""
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
        """All rows of a list; parameters that are None are left out."""
        return [row async for row in self._listed(path, None, PAGE, params)]

    async def _listed(
        self, path: str, limit: int | None, page: int, params: Mapping[str, Any]
    ) -> AsyncGenerator[Any, None]:
        """The rows of a list, page after page as they are needed."""
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
        """Events as they happen, over as many connections as it takes."""
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
        """A document once it has ended; each look at it goes to ``progress``.

        Raises:
            TimedOutError: It has not within the time.
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
