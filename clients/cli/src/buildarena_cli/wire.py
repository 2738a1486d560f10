"""HTTP for commands, on the standard library: it loads in a sixth of the time that httpx takes.

Each request has a connection of its own, so that any thread may send one.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from http.client import HTTPConnection, HTTPException, HTTPResponse, HTTPSConnection
from typing import IO, Any
from urllib.parse import SplitResult, urlencode, urlsplit

Failure = (OSError, HTTPException)
"""What a request raises when there is no server, or when the connection breaks off."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Response:
    """An answer, read to its end."""

    url: str
    status: int
    body: bytes
    retry_after: str = ""

    @property
    def failed(self) -> bool:
        """Whether it is anything but a success: redirects are not followed."""
        return not 200 <= self.status < 300  # noqa: PLR2004 - HTTP's classes

    def json(self) -> Any:
        """The JSON document that it holds.

        Raises:
            ValueError: It holds none.
        """
        return json.loads(self.body)


class Wire:
    """Sends requests to one server.

    Args:
        url: Where it is.
        headers: Sent with each request.

    Raises:
        ValueError: That is not the URL of an HTTP server.
    """

    def __init__(self, url: str, headers: Mapping[str, str]) -> None:
        parts = urlsplit(url)
        if parts.scheme not in {"http", "https"} or not parts.hostname:
            raise ValueError("it must begin with http:// or https:// and name a host")
        if parts.port == 0:
            raise ValueError("0 is not a port")
        self._parts: SplitResult = parts
        self._headers = dict(headers)

    def send(
        self,
        method: str,
        path: str,
        *,
        params: Mapping[str, Any] | None = None,
        body: bytes | IO[bytes] | None = None,
        headers: Mapping[str, str] | None = None,
        timeout_s: float | None,
    ) -> Response:
        """The answer to a request."""
        query = f"?{urlencode(_texts(params), doseq=True)}" if params else ""
        with self.opened(
            method, path + query, body=body, headers=headers, timeout_s=timeout_s
        ) as answer:
            return self.read(path + query, answer)

    def read(self, path: str, answer: HTTPResponse) -> Response:
        """The rest of an answer."""
        url = f"{self._parts.scheme}://{self._parts.netloc}{path}"
        return Response(
            url=url,
            status=answer.status,
            body=answer.read(),
            retry_after=answer.getheader("Retry-After", ""),
        )

    @contextmanager
    def opened(
        self,
        method: str,
        path: str,
        *,
        body: bytes | IO[bytes] | None = None,
        headers: Mapping[str, str] | None = None,
        timeout_s: float | None,
    ) -> Iterator[HTTPResponse]:
        """An answer of which only the head was read."""
        kind = HTTPSConnection if self._parts.scheme == "https" else HTTPConnection
        connection = kind(self._parts.hostname or "", self._parts.port, timeout=timeout_s)
        try:
            given = {**self._headers, **(headers or {})}
            connection.request(method, self._parts.path.rstrip("/") + path, body, given)
            yield connection.getresponse()
        finally:
            connection.close()


def _texts(params: Mapping[str, Any]) -> dict[str, Any]:
    """Parameters as the API reads them."""
    return {
        name: str(value).lower() if isinstance(value, bool) else value
        for name, value in params.items()
    }
