"""HTTP on the standard library: it loads in a sixth of the time that httpx takes.

Each request has a connection of its own, so that any thread may send one. No redirect is followed
and no proxy used: a key goes to one host.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from http.client import (
    BadStatusLine,
    HTTPConnection,
    HTTPException,
    HTTPResponse,
    HTTPSConnection,
    IncompleteRead,
    RemoteDisconnected,
)
from typing import Final
from urllib.parse import SplitResult, urlsplit

from buildarena_client.faults import (
    BrokenError,
    GarbledError,
    NoConnectionError,
    SilentError,
    WireError,
)
from buildarena_client.requests import Request, Response

CHUNK_BYTES: Final = 1 << 20


class Wire:
    """Sends requests to one server.

    Args:
        url: Where it is.
        headers: Sent with each request.
    """

    def __init__(self, url: str, headers: Mapping[str, str]) -> None:
        self._parts: SplitResult = urlsplit(url)
        self._headers = dict(headers)

    def send(self, request: Request) -> Response:
        """The answer to a request.

        Raises:
            WireError: None came.
        """
        with self.opened(request) as answer:
            return answer.read()

    @contextmanager
    def opened(self, request: Request) -> Iterator[Answer]:
        """An answer of which only the head was read.

        Raises:
            WireError: None came.
        """
        kind = HTTPSConnection if self._parts.scheme == "https" else HTTPConnection
        host = self._parts.hostname or ""
        connection = kind(host, self._parts.port, timeout=request.timeout_s)
        target = request.target()
        try:
            with _worded(connected=False):
                connection.connect()
            with _worded():
                headers = {**self._headers, **request.headers}
                path = self._parts.path.rstrip("/") + target
                connection.request(request.method, path, request.body, headers)
                answer = connection.getresponse()
            yield Answer(f"{self._parts.scheme}://{self._parts.netloc}{target}", answer)
        finally:
            connection.close()

    def close(self) -> None:
        """Nothing is kept open."""


class Answer:
    """An answer whose body is still to be read.

    Attributes:
        status: The HTTP status.
    """

    def __init__(self, url: str, answer: HTTPResponse) -> None:
        self._url = url
        self._answer = answer
        self.status = answer.status

    def read(self) -> Response:
        """The whole answer.

        Raises:
            WireError: It broke off.
        """
        with _worded():
            body = self._answer.read()
        retry_after = self._answer.getheader("Retry-After", "")
        return Response(url=self._url, status=self.status, body=body, retry_after=retry_after)

    def chunks(self) -> Iterator[bytes]:
        """Pieces of the body as they come, all of them or an error.

        Raises:
            WireError: It broke off.
        """
        while True:
            with _worded():
                chunk = self._answer.read1(CHUNK_BYTES)
            if not chunk:
                break
            yield chunk
        if self._answer.length:
            raise BrokenError(f"it broke off: {self._answer.length:,} bytes are missing")


@contextmanager
def _worded(*, connected: bool = True) -> Iterator[None]:
    try:
        yield
    except TimeoutError as error:
        raise SilentError(str(error) or "timed out") from error
    except (ConnectionError, IncompleteRead, RemoteDisconnected) as error:
        raise (BrokenError if connected else NoConnectionError)(_words(error)) from error
    except (BadStatusLine, HTTPException) as error:
        raise GarbledError(_words(error)) from error
    except OSError as error:
        raise (BrokenError if connected else NoConnectionError)(_words(error)) from error


def _words(error: Exception) -> str:
    return str(error) or type(error).__name__


__all__ = ["CHUNK_BYTES", "Answer", "Wire", "WireError"]
