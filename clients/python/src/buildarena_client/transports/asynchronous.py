"""HTTP on httpx2, for the asynchronous client.

Connections are kept and shared, by at most so many requests at once as the client allows.
"""

from __future__ import annotations

import asyncio
import ssl
from collections.abc import AsyncGenerator, AsyncIterator, Iterator, Mapping
from contextlib import asynccontextmanager, contextmanager
from typing import BinaryIO, Final

from buildarena_client.errors import MissingLibraryError
from buildarena_client.event_streams import MAX_EVENT_BYTES, Message, no_events
from buildarena_client.requests import Request, Response
from buildarena_client.transport_errors import (
    BrokenError,
    GarbledError,
    NoConnectionError,
    SilentError,
    text_of,
)

try:
    import httpx2
except ImportError as error:
    raise MissingLibraryError("the asynchronous client", library="httpx2", extra="async") from error

CHUNK_BYTES: Final = 1 << 20
KEEPALIVE_S: Final = 2.0
"""How long an idle connection is kept: servers close theirs after five seconds, and a request that
meets that moment would break off."""


class AsyncTransport:
    """Sends requests to one server, as ``transports.Transport`` says.

    Args:
        url: Where it is.
        headers: Sent with each request.
        at_once: Requests that are open at most; further ones wait. Streams are not counted.
    """

    def __init__(self, url: str, headers: Mapping[str, str], *, at_once: int) -> None:
        self._url = url
        self._slots = asyncio.Semaphore(at_once)
        # The environment's proxies and .netrc would see the key, or put another in its place.
        self._client = httpx2.AsyncClient(
            headers={"Accept-Encoding": "identity", **headers},
            follow_redirects=False,
            trust_env=False,
            verify=ssl.create_default_context() if url.startswith("https:") else False,
            limits=httpx2.Limits(
                max_connections=None,
                max_keepalive_connections=at_once,
                keepalive_expiry=KEEPALIVE_S,
            ),
        )

    async def send(self, request: Request) -> Response:
        """The answer to a request."""
        async with self._slots, self.opened(request) as answer:
            return await answer.read()

    @asynccontextmanager
    async def opened(self, request: Request) -> AsyncGenerator[AsyncAnswer, None]:
        """The answer to a request, to be read on."""
        target = request.target()
        body = request.body
        with _translated_errors():
            made = self._client.build_request(
                request.method,
                self._url + target,
                content=body if body is None or isinstance(body, bytes) else _pieces(body),
                headers=dict(request.headers),
                timeout=request.timeout_s,
            )
            answer = await self._client.send(made, stream=True)
        try:
            yield AsyncAnswer(answer)
        finally:
            await answer.aclose()

    async def pause(self, seconds: float) -> None:
        """Waits before a request is sent again."""
        await asyncio.sleep(seconds)

    async def close(self) -> None:
        """Closes connections that are kept."""
        await self._client.aclose()


class AsyncAnswer:
    """An answer of which only the head was read, as ``transports.Answer`` says."""

    def __init__(self, answer: httpx2.Response) -> None:
        self._answer = answer
        self.status = answer.status_code

    @property
    def has_begun(self) -> bool:
        """Whether anything of the body came."""
        return self._answer.num_bytes_downloaded > 0

    async def read(self) -> Response:
        """The whole answer."""
        with _translated_errors():
            body = await self._answer.aread()
        return Response(
            url=str(self._answer.url),
            status=self.status,
            body=body,
            retry_after=self._answer.headers.get("Retry-After", ""),
        )

    async def chunks(self) -> AsyncGenerator[bytes, None]:
        """The body as it comes: all of it, or an error."""
        with _translated_errors():
            async for chunk in self._answer.aiter_raw():
                yield chunk

    async def messages(self) -> AsyncGenerator[Message, None]:
        """The body as server-sent events."""
        with _translated_errors():
            async for event in httpx2.EventSource(self._answer, MAX_EVENT_BYTES):
                if event.data:
                    yield Message(event.id, event.event, event.data)


async def _pieces(file: BinaryIO) -> AsyncIterator[bytes]:
    while chunk := await asyncio.to_thread(file.read, CHUNK_BYTES):
        yield chunk


@contextmanager
def _translated_errors() -> Iterator[None]:
    try:
        yield
    except httpx2.SSEError as error:
        raise no_events() from error
    except (httpx2.ConnectError, httpx2.UnsupportedProtocol) as error:
        raise NoConnectionError(text_of(error)) from error
    except httpx2.TimeoutException as error:
        raise SilentError(str(error) or "timed out") from error
    except httpx2.RemoteProtocolError as error:
        raise _protocol_error(error) from error
    except httpx2.DecodingError as error:
        raise GarbledError(text_of(error)) from error
    except (httpx2.TransportError, httpx2.StreamError) as error:
        raise BrokenError(text_of(error)) from error


def _protocol_error(error: httpx2.RemoteProtocolError) -> BrokenError | GarbledError:
    """Whether an answer broke off or was none: httpx2 tells them apart by their words alone."""
    text = text_of(error)
    cut = ("disconnected without", "without sending complete", "incomplete chunked read")
    return BrokenError(text) if any(words in text for words in cut) else GarbledError(text)
