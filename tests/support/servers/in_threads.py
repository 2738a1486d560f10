"""Servers on loopback, each in a thread, of what a handler says."""

import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.server import ThreadingHTTPServer
from socketserver import TCPServer
from typing import Any


class Quiet:
    """A handler that writes no log."""

    def log_message(self, *_: object) -> None:
        """Says nothing."""


class Server(ThreadingHTTPServer):
    """Answers every request in a thread of its own."""

    daemon_threads = True
    request_queue_size = 256

    def handle_error(self, *given: Any) -> None:
        """Clients may leave in the middle of an answer."""
        if not isinstance(sys.exception(), ConnectionError):
            super().handle_error(*given)


@contextmanager
def serving(handler: Callable[..., Any], kind: type[TCPServer] = Server) -> Iterator[str]:
    """Serves until the block is left; yields the URL."""
    with kind(("127.0.0.1", 0), handler) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.01,))
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_address[1]}"
        finally:
            server.shutdown()
            thread.join()
