"""HTTP on httpx, for the asynchronous client: the same promises as the synchronous wire's.

Connections are kept and shared, by at most so many requests at once as the client allows.
"""

from __future__ import annotations

import asyncio
import ssl
from collections.abc import AsyncIterator, Iterator, Mapping
from contextlib import asynccontextmanager, contextmanager
from typing import BinaryIO, Final

from buildarena_client.errors import MissingLibraryError
from buildarena_client.faults import BrokenError, GarbledError, NoConnectionError, SilentError
from buildarena_client.requests import Request, Response

try:
    import httpx
except ImportError as error:
    raise MissingLibraryError("the asynchronous client", library="httpx", extra="async") from error

CHUNK_BYTES: Final = 1 << 20
KEPT_S: Final = 2.0
"""How long an idle connection is kept: servers close theirs after five seconds, and a request that
meets that moment would break off."""


class AsyncWire:
    """Sends requests to one server.

    Args:
        url: Where it is.
        headers: Sent with each request.
        at_once: Requests that are open at most; further ones wait. Streams are not counted.
    """

    def __init__(self, url: str, headers: Mapping[str, str], *, at_once: int) -> None:
        self._url = url
        self._turns = asyncio.Semaphore(at_once)
        # The environment's proxies and .netrc would see the key, or put another in its place.
        self._client = httpx.AsyncClient(
            headers={"Accept-Encoding": "identity", **headers},
            follow_redirects=False,
            trust_env=False,
            verify=ssl.create_default_context() if url.startswith("https:") else False,
            limits=httpx.Limits(
                max_connections=None, max_keepalive_connections=at_once, keepalive_expiry=KEPT_S
            ),
        )

    async def send(self, request: Request) -> Response:
        """The answer to a request.

        Raises:
            WireError: None came.
        """
        async with self._turns, self.opened(request) as answer:
            return await answer.read()

    @asynccontextmanager
    async def opened(self, request: Request) -> AsyncIterator[AsyncAnswer]:
        """An answer of which only the head was read.

        Raises:
            WireError: None came.
        """
        target = request.target()
        body = request.body
        with _worded():
            made = self._client.build_request(
                request.method,
                self._url + target,
                content=body if body is None or isinstance(body, bytes) else _read(body),
                headers=dict(request.headers),
                timeout=request.timeout_s,
            )
            answer = await self._client.send(made, stream=True)
        try:
            yield AsyncAnswer(str(made.url), answer)
        finally:
            await answer.aclose()

    async def close(self) -> None:
        """Closes connections that are kept."""
        await self._client.aclose()


class AsyncAnswer:
    """An answer whose body is still to be read.

    Attributes:
        status: The HTTP status.
    """

    def __init__(self, url: str, answer: httpx.Response) -> None:
        self._url = url
        self._answer = answer
        self.status = answer.status_code

    async def read(self) -> Response:
        """The whole answer.

        Raises:
            WireError: It broke off.
        """
        with _worded():
            body = await self._answer.aread()
        retry_after = self._answer.headers.get("Retry-After", "")
        return Response(url=self._url, status=self.status, body=body, retry_after=retry_after)

    async def chunks(self) -> AsyncIterator[bytes]:
        """Pieces of the body as they come, all of them or an error.

        Raises:
            WireError: It broke off.
        """
        pieces = self._answer.aiter_raw()
        while True:
            with _worded():
                chunk = await anext(pieces, None)
            if chunk is None:
                return
            yield chunk


async def _read(file: BinaryIO) -> AsyncIterator[bytes]:
    while chunk := await asyncio.to_thread(file.read, CHUNK_BYTES):
        yield chunk


@contextmanager
def _worded() -> Iterator[None]:
    try:
        yield
    except (httpx.ConnectError, httpx.UnsupportedProtocol) as error:
        raise NoConnectionError(_words(error)) from error
    except httpx.TimeoutException as error:
        raise SilentError(str(error) or "timed out") from error
    except httpx.RemoteProtocolError as error:
        raise _protocol(error) from error
    except httpx.DecodingError as error:
        raise GarbledError(_words(error)) from error
    except (httpx.TransportError, httpx.StreamError) as error:
        raise BrokenError(_words(error)) from error


def _protocol(error: httpx.RemoteProtocolError) -> BrokenError | GarbledError:
    """Whether an answer broke off or was none: httpx tells them apart by their words alone."""
    text = _words(error)
    cut = ("disconnected without", "without sending complete", "incomplete chunked read")
    return BrokenError(text) if any(words in text for words in cut) else GarbledError(text)


def _words(error: Exception) -> str:
    return str(error) or type(error).__name__
