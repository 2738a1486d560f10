"""A proxy to any TCP server that breaks connections off in the middle, or falls silent."""

import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from socketserver import BaseRequestHandler
from urllib.parse import urlsplit

from support.servers.in_threads import serving


@dataclass
class FlakyProxy:
    """Passes bytes on, and cuts connections.

    Attributes:
        target: Host and port of the server.
        cut_after: Bytes from the client after which each of the next connections is cut; each
            number is used once.
        swallow_answers: How many answers are lost, although their requests arrived.
        silent: How many connections fall silent before their first answer: both ends stay open,
            as over a link that died, and hear nothing more.
        away: Whether every connection is refused.
        hushed: Whether nothing passes for now; connections stay open, and it passes later.
        cuts: Connections that were cut.
        over: Set when the proxy ends.
    """

    target: tuple[str, int]
    cut_after: list[int] = field(default_factory=list)
    swallow_answers: int = 0
    silent: int = 0
    away: bool = False
    hushed: bool = False
    cuts: int = 0
    url: str = ""
    over: threading.Event = field(default_factory=threading.Event)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def serve(self, client: socket.socket) -> None:
        if self.away:
            client.close()
            return
        with client, socket.create_connection(self.target) as server:
            back = threading.Thread(target=self._answers, args=(server, client), daemon=True)
            back.start()
            with suppress(OSError):
                self._requests(client, server)
            for end in (client, server):
                with suppress(OSError):
                    end.shutdown(socket.SHUT_RDWR)
            back.join(5)

    def _hold(self) -> None:
        while self.hushed and not self.over.wait(0.02):
            pass

    def _requests(self, client: socket.socket, server: socket.socket) -> None:
        passed = 0
        while data := client.recv(4096):
            passed += len(data)
            with self._lock:
                if self.away:
                    return
                # Only uploads are as long as that.
                if self.cut_after and passed > self.cut_after[0]:
                    self.cut_after.pop(0)
                    self.cuts += 1
                    return
            self._hold()
            server.sendall(data)

    def _answers(self, server: socket.socket, client: socket.socket) -> None:
        with suppress(OSError):
            while data := server.recv(65536):
                with self._lock:
                    silent, self.silent = bool(self.silent), max(0, self.silent - 1)
                    self.cuts += silent
                if silent:
                    self.over.wait()
                    return
                with self._lock:
                    if self.swallow_answers and data.startswith(b"HTTP/1.1 2"):
                        self.swallow_answers -= 1
                        self.cuts += 1
                        client.shutdown(socket.SHUT_RDWR)
                        return
                self._hold()
                client.sendall(data)


@contextmanager
def flaky_proxy(url: str) -> Iterator[FlakyProxy]:
    """A proxy in front of a server."""
    at = urlsplit(url)
    assert at.port is not None
    proxy = FlakyProxy((at.hostname or "127.0.0.1", at.port))

    class Passing(BaseRequestHandler):
        def handle(self) -> None:
            proxy.serve(self.request)

    with serving(Passing) as own:
        proxy.url = url.replace(f":{at.port}", f":{urlsplit(own).port}", 1)
        try:
            yield proxy
        finally:
            proxy.away = True
            proxy.over.set()
