"""A server that answers as it is told, rightly or wrongly, and keeps what it was sent."""

import socket
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

WITHIN_S = 5.0


@dataclass
class WrongServer:
    """A server."""

    url: str
    received: list[bytes] = field(default_factory=list)

    @property
    def lines(self) -> list[str]:
        """The first line of every request."""
        return [request.split(b"\r\n", 1)[0].decode() for request in self.received]

    def headers(self, name: str) -> list[str]:
        """What each request said in a header; nothing for those without."""
        found = []
        for request in self.received:
            head = request.partition(b"\r\n\r\n")[0].decode().split("\r\n")[1:]
            given = {line.partition(":")[0].lower(): line.partition(": ")[2] for line in head}
            found.append(given.get(name.lower(), ""))
        return found


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
    with socket.create_server(("127.0.0.1", 0)) as listening:
        made = WrongServer(f"http://127.0.0.1:{listening.getsockname()[1]}")
        thread = threading.Thread(target=_serve, args=(listening, made, answers))
        thread.start()
        try:
            yield made
        finally:
            listening.shutdown(socket.SHUT_RDWR)
            thread.join()


def _serve(listening: socket.socket, made: WrongServer, answers: Sequence[bytes | None]) -> None:
    while True:
        try:
            connection, _ = listening.accept()
        except OSError:
            return
        with connection:
            connection.settimeout(WITHIN_S)
            made.received.append(_request(connection))
            said = answers[min(len(made.received), len(answers)) - 1]
            try:
                if said is None:
                    connection.recv(1)
                else:
                    connection.sendall(said)
            except OSError:
                continue


def _request(connection: socket.socket) -> bytes:
    """A request with as much body as its head names."""
    data = b""
    while b"\r\n\r\n" not in data and (more := connection.recv(65536)):
        data += more
    head, _, body = data.partition(b"\r\n\r\n")
    length = 0
    for line in head.split(b"\r\n"):
        name, _, value = line.partition(b":")
        if name.lower() == b"content-length":
            length = int(value)
    while len(body) < length and (more := connection.recv(65536)):
        body += more
    return head + b"\r\n\r\n" + body
