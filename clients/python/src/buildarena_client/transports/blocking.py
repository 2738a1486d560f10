"""HTTP on the standard library: it loads in a fraction of the time that httpx2 takes.

Its coroutines block, and never suspend: ``client.run`` carries them out without an event loop.
Each request has a connection of its own, so that any thread may send one.
"""

from __future__ import annotations

import time
from collections.abc import AsyncGenerator, Iterator, Mapping
from contextlib import asynccontextmanager, contextmanager
from http.client import (
    HTTPConnection,
    HTTPException,
    HTTPResponse,
    HTTPSConnection,
    IncompleteRead,
)
from typing import Final
from urllib.parse import SplitResult, urlsplit

from buildarena_client.event_streams import MAX_EVENT_BYTES, MEDIA_TYPE, Message, no_events
from buildarena_client.requests import Request, Response
from buildarena_client.transport_errors import (
    BrokenError,
    GarbledError,
    NoConnectionError,
    SilentError,
    text_of,
)

CHUNK_BYTES: Final = 1 << 20


class BlockingTransport:
    """Sends requests to one server, as ``transports.Transport`` says.

    Args:
        url: Where it is.
        headers: Sent with each request.
    """

    def __init__(self, url: str, headers: Mapping[str, str]) -> None:
        self._parts: SplitResult = urlsplit(url)
        self._headers = dict(headers)

    async def send(self, request: Request) -> Response:
        """The answer to a request."""
        async with self.opened(request) as answer:
            return await answer.read()

    @asynccontextmanager
    async def opened(self, request: Request) -> AsyncGenerator[BlockingAnswer, None]:
        """The answer to a request, to be read on."""
        connection_type = HTTPSConnection if self._parts.scheme == "https" else HTTPConnection
        host = self._parts.hostname or ""
        connection = connection_type(host, self._parts.port, timeout=request.timeout_s)
        target = request.target()
        try:
            with _translated_errors(connected=False):
                connection.connect()
            with _translated_errors():
                headers = {**self._headers, **request.headers}
                path = self._parts.path.rstrip("/") + target
                connection.request(request.method, path, request.body, headers)
                answer = connection.getresponse()
            yield BlockingAnswer(f"{self._parts.scheme}://{self._parts.netloc}{target}", answer)
        finally:
            connection.close()

    async def pause(self, seconds: float) -> None:
        """Waits before a request is sent again."""
        time.sleep(seconds)  # noqa: ASYNC251 - there is no event loop

    async def close(self) -> None:
        """No connection is kept."""


class BlockingAnswer:
    """An answer of which only the head was read, as ``transports.Answer`` says."""

    def __init__(self, url: str, answer: HTTPResponse) -> None:
        self._url = url
        self._answer = answer
        self.status = answer.status
        self.has_begun = False

    async def read(self) -> Response:
        """The whole answer."""
        with _translated_errors():
            body = self._answer.read()
        retry_after = self._answer.getheader("Retry-After", "")
        return Response(url=self._url, status=self.status, body=body, retry_after=retry_after)

    async def chunks(self) -> AsyncGenerator[bytes, None]:
        """The body as it comes: all of it, or an error."""
        with _translated_errors():
            while chunk := self._answer.read1(CHUNK_BYTES):
                yield chunk
        if self._answer.length:
            raise BrokenError(f"it broke off: {self._answer.length:,} bytes are missing")

    async def messages(self) -> AsyncGenerator[Message, None]:
        """The body as server-sent events."""
        if self._answer.getheader("Content-Type", "").partition(";")[0] != MEDIA_TYPE:
            raise no_events()
        event_id, kind, data = "", "message", list[str]()
        with _translated_errors():
            while line := self._answer.readline(MAX_EVENT_BYTES):
                self.has_begun = True
                if len(line) == MAX_EVENT_BYTES:
                    raise no_events()
                name, _, value = line.decode("utf-8", "replace").rstrip("\r\n").partition(":")
                value = value.removeprefix(" ")
                if name == "id":
                    event_id = value
                elif name == "event":
                    kind = value or "message"
                elif name == "data":
                    data.append(value)
                elif not name and not value and data:
                    yield Message(event_id, kind, "\n".join(data))
                    kind, data = "message", []


@contextmanager
def _translated_errors(*, connected: bool = True) -> Iterator[None]:
    try:
        yield
    except TimeoutError as error:
        raise SilentError(str(error) or "timed out") from error
    except (OSError, IncompleteRead) as error:
        raise (BrokenError if connected else NoConnectionError)(text_of(error)) from error
    except HTTPException as error:
        raise GarbledError(text_of(error)) from error
