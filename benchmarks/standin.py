"""A model provider for benchmarks: one event loop that answers each request after a set time.

A reply is worked out when its request arrives and sent when its time has come, so that this
process adds nothing to the latency as long as it has processor time left. It costs a third of a
millisecond a request, which leaves the machine to the service that is measured.

Until it is sent SIGUSR1 it answers soon, to keep waits short while a service warms up.
"""

import asyncio
import json
import signal
import sys

from support.providers.stand_in import OpenAIWire

from buildarena_worker.builtin import MODELS

HEAD = b"HTTP/1.1 200 OK\r\ncontent-type: application/json\r\ncontent-length: %d\r\n\r\n%b"


class Connection(asyncio.Protocol):
    """One client's connection, one request after the other."""

    answered = 0
    latency_s = 0.05

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._received = bytearray()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Keeps the way back."""
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport

    def data_received(self, data: bytes) -> None:
        """Answers when the request is whole."""
        due = self._loop.time() + self.latency_s
        self._received += data
        end = self._received.find(b"\r\n\r\n") + 4
        if end < 4:
            return
        head = self._received[:end].lower()
        size = int(head.split(b"content-length:", 1)[1].split(b"\r\n", 1)[0])
        if len(self._received) < end + size:
            return
        body = bytes(self._received[end : end + size])
        del self._received[: end + size]
        self._loop.call_at(due, self._transport.write, _answer(body))


def _answer(body: bytes) -> bytes:
    reply = MODELS["expert"](OpenAIWire.read(json.loads(body)))
    Connection.answered += 1
    used = len(body) // 4, 1 + len(reply.text) // 4, len(body) // 16
    data = json.dumps(OpenAIWire.write(reply, used, Connection.answered)).encode()
    return HEAD % (len(data), data)


async def main() -> None:
    """Serves until the process is ended; the first line printed is the address."""
    loop = asyncio.get_running_loop()
    loop.add_signal_handler(
        signal.SIGUSR1, lambda: setattr(Connection, "latency_s", float(sys.argv[1]))
    )
    server = await loop.create_server(Connection, "127.0.0.1", 0, backlog=2000)
    sys.stdout.write(f"http://127.0.0.1:{server.sockets[0].getsockname()[1]}\n")
    sys.stdout.flush()
    await server.serve_forever()


if __name__ == "__main__":
    asyncio.run(main())
