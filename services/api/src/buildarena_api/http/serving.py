"""The HTTP server of an API process."""

from __future__ import annotations

import os
import signal
import socket
import sys
from contextlib import suppress
from typing import Any

import uvicorn

from buildarena_backend.keepalive import socket_options

UNANSWERED_S = 60
"""A client may leave what it is sent unread for so long: whoever only reads slowly is not dead."""


class Server(uvicorn.Server):
    """A server that gives up clients which are gone without a word.

    Such a client would otherwise keep its stream, one of those that it may have, for a quarter of
    an hour, and a connection that it says nothing over forever.
    """

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Begins to listen; connections that are taken have the options of what listens."""
        await super().startup(sockets=sockets)
        options = socket_options(unanswered_s=UNANSWERED_S)
        for listening in (one for server in self.servers for one in server.sockets):
            with socket.socket(fileno=os.dup(listening.fileno())) as sock:
                for level, name, value in options:
                    sock.setsockopt(level, name, value)


def serve(app: Any, **settings: Any) -> None:
    """Serves an application until the process is asked to stop; exits when it can't listen.

    The server raises the signal that stopped it once more when it has ended: it ends this call, and
    not the process, which still has spans to send.
    """
    signal.signal(signal.SIGTERM, _stop)
    server = Server(uvicorn.Config(app, **settings))
    with suppress(KeyboardInterrupt):
        server.run()
    if not server.started:
        sys.exit(3)


def _stop(*_: object) -> None:
    sys.exit(0)
