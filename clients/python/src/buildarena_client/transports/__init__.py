"""What requests are sent through: the standard library, or httpx2."""

from __future__ import annotations

from collections.abc import AsyncGenerator, Callable, Mapping
from contextlib import AbstractAsyncContextManager
from typing import Protocol

from buildarena_client.event_streams import Message
from buildarena_client.requests import Request, Response


class Answer(Protocol):
    """An answer of which only the head was read. What reads on raises TransportErrors."""

    @property
    def status(self) -> int:
        """The HTTP status."""

    @property
    def has_begun(self) -> bool:
        """Whether anything of the body came."""

    async def read(self) -> Response:
        """The whole answer."""

    def chunks(self) -> AsyncGenerator[bytes, None]:
        """The body as it comes: all of it, or an error."""

    def messages(self) -> AsyncGenerator[Message, None]:
        """The body as server-sent events; ends where the stream ends.

        Raises:
            NotAnApiError: It is something else.
        """


class Transport(Protocol):
    """Sends requests to one server. No redirect is followed and no proxy used."""

    async def send(self, request: Request) -> Response:
        """The answer to a request.

        Raises:
            TransportError: None came.
        """

    def opened(self, request: Request) -> AbstractAsyncContextManager[Answer]:
        """The answer to a request, to be read on.

        Raises:
            TransportError: None came.
        """

    async def pause(self, seconds: float) -> None:
        """Waits before a request is sent again."""

    async def close(self) -> None:
        """Closes connections that are kept."""


OpenTransport = Callable[[str, Mapping[str, str]], Transport]
"""Makes the transport to a URL, with the headers of each request."""
