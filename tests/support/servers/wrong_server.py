"""A server that answers as it is told, rightly or wrongly, and keeps what it was sent."""

import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from socketserver import StreamRequestHandler, TCPServer

from support.servers.in_threads import serving

LENGTH = re.compile(rb"^content-length: *(\d+)", re.IGNORECASE | re.MULTILINE)


@dataclass
class WrongServer:
    """A server."""

    url: str = ""
    received: list[bytes] = field(default_factory=list)

    @property
    def lines(self) -> list[str]:
        """The first line of every request."""
        return [request.split(b"\r\n", 1)[0].decode() for request in self.received]

    def headers(self, name: str) -> list[str]:
        """What each request said in a header; nothing for those without."""
        line = re.compile(rf"^{name}: (.*)\r$", re.IGNORECASE | re.MULTILINE)
        heads = [request.partition(b"\r\n\r\n")[0].decode() + "\r" for request in self.received]
        return [found[1] if (found := line.search(head)) else "" for head in heads]


def answer(status: int, body: bytes = b"{}", **headers: str) -> bytes:
    """An answer as it is sent."""
    lines = [f"HTTP/1.1 {status} x", "Connection: close", f"Content-Length: {len(body)}"]
    lines += [f"{name.replace('_', '-')}: {value}" for name, value in headers.items()]
    return "\r\n".join(lines).encode() + b"\r\n\r\n" + body


@contextmanager
def wrong_server(*answers: bytes | None) -> Iterator[WrongServer]:
    """Serves one answer after another, the last one again and again.

    Args:
        answers: Bytes to send before the connection is closed; None to say nothing until the
            client leaves.
    """
    made = WrongServer()

    class Handler(StreamRequestHandler):
        timeout = 5.0

        def handle(self) -> None:
            head = b""
            while line := self.rfile.readline():
                head += line
                if line == b"\r\n":
                    break
            length = LENGTH.search(head)
            made.received.append(head + self.rfile.read(int(length[1]) if length else 0))
            said = answers[min(len(made.received), len(answers)) - 1]
            with suppress(OSError):
                if said is None:
                    self.rfile.read(1)
                else:
                    self.wfile.write(said)

    with serving(Handler, TCPServer) as made.url:
        yield made
