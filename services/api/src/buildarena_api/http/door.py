"""The front door: limits on connections and on the time and size of headers.

A connection costs a descriptor before its sender is known, so it is counted when it is accepted:
for its address, unless that is a trusted proxy's, and for the process. One too many may still
send a request, for a moment: if it is `GET /v1/health`, it is answered. Of those in this anteroom
the oldest makes room for the newest, so that a probe, which sends its request at once, is answered
however many others are silent.
"""

from __future__ import annotations

import asyncio
import os
import resource
import signal
import socket
import sys
from collections import Counter
from contextlib import suppress
from functools import partial
from http import HTTPStatus
from typing import Any, Final

import httptools
import structlog
import uvicorn
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

from buildarena_api.http.forwarded_headers import Networks
from buildarena_api.http.problems import ErrorCode, ProblemError
from buildarena_backend.keepalive import socket_options
from buildarena_backend.settings import Settings

MAX_CONNECTIONS: Final = 8_000
"""Connections of a process; fewer where it may not open so many files."""
MIN_CONNECTIONS: Final = 100
MAX_OF_AN_ADDRESS: Final = 1_000
ANTEROOM: Final = 256
"""Connections beyond these that may still request the service's health."""
OWN_DESCRIPTORS: Final = 256
"""Files and connections that the process opens itself."""
HEADER_S: Final = 10.0
"""Limit for the arrival of a request's header."""
ANTEROOM_S: Final = 2.0
MAX_HEADER_BYTES: Final = 32 * 1024
MAX_HEADERS: Final = 100
UNANSWERED_S: Final = 60
"""Time for which a client may leave sent data unread: a slow reader is not dead."""
LOG_EVERY_S: Final = 10.0

log = structlog.get_logger(__name__)


class Door:
    """Counts the connections of a process.

    Args:
        settings: Name the proxies whose connections are many clients'.
        limit: Connections of all addresses.
        limit_each: Connections of one.
    """

    def __init__(self, settings: Settings, *, limit: int, limit_each: int) -> None:
        self._limit, self._limit_each = limit, limit_each
        self._proxies = Networks(settings.trusted_proxies)
        base = settings.base_path.encode()
        self._health = (b"GET /v1/health ", b"GET " + base + b"/v1/health ")
        self._open: Counter[str] = Counter()
        self._total = 0
        self._anteroom: dict[FrontDoor, None] = {}
        self._answering: set[FrontDoor] = set()
        self._refused, self._logged_at = 0, -LOG_EVERY_S

    def admit(self, connection: FrontDoor, address: str) -> bool:
        """Count a connection; return whether it may request anything, or only the health."""
        has_room = self._open[address] < self._limit_each or address in self._proxies
        if has_room and self._total < self._limit:
            self._open[address] += 1
            self._total += 1
            return True
        if len(self._anteroom) >= ANTEROOM:
            oldest = next(iter(self._anteroom))
            del self._anteroom[oldest]
            oldest.transport.abort()
        self._anteroom[connection] = None
        self._note(address)
        return False

    def asks_for_health(self, connection: FrontDoor, data: bytes) -> bool:
        """Return whether a connection in the anteroom requests the health, answered at once."""
        is_complete = data.startswith(self._health) and data.endswith(b"\r\n\r\n")
        if not is_complete or len(self._answering) >= ANTEROOM:
            return False
        self._anteroom.pop(connection, None)
        self._answering.add(connection)
        return True

    def leave(self, connection: FrontDoor, address: str) -> None:
        """Count a connection no more."""
        if connection.is_admitted:
            self._total -= 1
            self._open[address] -= 1
            if not self._open[address]:
                del self._open[address]
        else:
            self._anteroom.pop(connection, None)
            self._answering.discard(connection)

    def _note(self, address: str) -> None:
        self._refused += 1
        now = asyncio.get_running_loop().time()
        if now - self._logged_at > LOG_EVERY_S:
            log.warning("connections_refused", connections=self._refused, last=address)
            self._logged_at, self._refused = now, 0


class FrontDoor(HttpToolsProtocol):
    """A connection: uvicorn's protocol, with bounds on data before its sender is known."""

    def __init__(self, door: Door, **options: Any) -> None:
        super().__init__(**options)
        self._door = door
        self._awaits_header = True
        self._header_bytes = 0
        self._deadline: asyncio.TimerHandle | None = None
        self._refusal = ProblemError(ErrorCode.BROKEN_BODY, "this is not an HTTP request")
        self.is_admitted = False

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Count the connection, and wait for its first request."""
        super().connection_made(transport)
        self._address = self.client[0] if self.client else ""
        self.is_admitted = self._door.admit(self, self._address)
        self._expect_header(HEADER_S if self.is_admitted else ANTEROOM_S)

    def connection_lost(self, exc: Exception | None) -> None:
        """Count it no more."""
        self._stop_waiting()
        self._door.leave(self, self._address)
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Continue to read, unless the header is too large or the connection was not admitted."""
        if not (self.is_admitted or self._door.asks_for_health(self, data)):
            self.transport.abort()
            return
        if self._awaits_header:
            self._header_bytes += len(data)
            if self._deadline is None:
                self._expect_header(HEADER_S)
        super().data_received(data)
        # All data belongs to the header until its end.
        if self._header_bytes > MAX_HEADER_BYTES and not self.transport.is_closing():
            self._refuse_header()
            self.send_400_response("")

    def on_headers_complete(self) -> None:
        """Pass a request on whose header is small enough."""
        self._stop_waiting()
        self._awaits_header, self._header_bytes = False, 0
        size = len(self.url) + sum(len(name) + len(value) for name, value in self.headers)
        if len(self.headers) > MAX_HEADERS or size > MAX_HEADER_BYTES:
            self._refuse_header()
            raise httptools.HttpParserError(self._refusal.detail)
        super().on_headers_complete()

    def on_message_complete(self) -> None:
        """Expect another request's header next."""
        self._awaits_header = True
        super().on_message_complete()

    def on_response_complete(self) -> None:
        """End a connection whose request was answered before it was complete."""
        super().on_response_complete()
        if not (self.is_admitted and self._awaits_header):
            self.transport.close()

    def send_400_response(self, msg: str) -> None:
        """Send a problem with the reason for the refusal, and end the connection."""
        del msg  # uvicorn's own
        answer = self._refusal.answer()
        phrase = HTTPStatus(answer.status_code).phrase
        head = (
            f"HTTP/1.1 {answer.status_code} {phrase}\r\nContent-Type: application/problem+json\r\n"
            f"Content-Length: {len(answer.body)}\r\nConnection: close\r\n\r\n"
        )
        self.transport.write(head.encode() + answer.body)
        self.transport.close()

    def _refuse_header(self) -> None:
        self._refusal = ProblemError(
            ErrorCode.HEADER_TOO_LARGE,
            f"a header has at most {MAX_HEADER_BYTES:,} bytes and {MAX_HEADERS} fields",
        )

    def _expect_header(self, seconds: float) -> None:
        self._deadline = self.loop.call_later(seconds, self.transport.abort)

    def _stop_waiting(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None


class Server(uvicorn.Server):
    """A server that closes connections of dead clients.

    Such a client would otherwise keep its stream, one of those that it may have, for a quarter of
    an hour, and a connection that it says nothing over forever.
    """

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Begin to listen; accepted connections inherit the socket's options."""
        await super().startup(sockets=sockets)
        options = socket_options(unanswered_s=UNANSWERED_S)
        for listening in (inner for server in self.servers for inner in server.sockets):
            with socket.socket(fileno=os.dup(listening.fileno())) as sock:
                for level, name, value in options:
                    sock.setsockopt(level, name, value)


def server_config(app: Any, settings: Settings, **more: Any) -> uvicorn.Config:
    """Return the server's configuration for an application behind the door.

    Args:
        more: Further options of uvicorn, or other ones than those of the settings.
    """
    door = Door(settings, limit=_room(), limit_each=MAX_OF_AN_ADDRESS)
    protocol: Any = partial(FrontDoor, door)
    listening = {"host": settings.host, "port": settings.port, "timeout_graceful_shutdown": 5}
    return uvicorn.Config(
        app,
        http=protocol,
        ws="none",
        log_config=None,
        access_log=False,
        proxy_headers=False,  # the application itself reads them, from trusted proxies
        **{**listening, **more},
    )


def serve(config: uvicorn.Config) -> None:
    """Serve an application until the process is asked to stop; exit when it can't listen.

    The server raises the signal that stopped it once more when it has ended: it ends this call, and
    not the process, which still has spans to send.
    """
    signal.signal(signal.SIGTERM, _stop)
    server = Server(config)
    with suppress(KeyboardInterrupt):
        server.run()
    if not server.started:
        sys.exit(3)


def _room() -> int:
    """Return for how many connections there are descriptors, after raising the process' limit."""
    descriptors = MAX_CONNECTIONS + OWN_DESCRIPTORS + 2 * ANTEROOM
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    unbounded = resource.RLIM_INFINITY
    limit = descriptors if hard == unbounded else min(descriptors, hard)
    if soft != unbounded and soft < limit:
        resource.setrlimit(resource.RLIMIT_NOFILE, (limit, hard))
    return max(MIN_CONNECTIONS, limit - OWN_DESCRIPTORS - 2 * ANTEROOM)


def _stop(*_: object) -> None:
    sys.exit(0)
