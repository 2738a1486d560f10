"""A proxy to any TCP server that can fall silent: connections are taken and nothing is said."""

import asyncio
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from urllib.parse import urlsplit


class HushedProxy:
    """Passes bytes on, unless it is told to be silent.

    Attributes:
        url: That of the server, by way of the proxy.
    """

    def __init__(self, url: str) -> None:
        target = urlsplit(url)
        assert target.port is not None
        self._target = target.hostname or "127.0.0.1", target.port
        self._loop = asyncio.new_event_loop()
        self._speaks = asyncio.Event()
        self._speaks.set()
        self._server = self._loop.run_until_complete(
            asyncio.start_server(self._serve, "127.0.0.1", 0)
        )
        port = self._server.sockets[0].getsockname()[1]
        netloc = target.netloc.replace(f":{target.port}", f":{port}")
        self.url = target._replace(netloc=netloc).geturl()
        self._thread = threading.Thread(target=self._loop.run_forever)
        self._thread.start()

    def hush(self) -> None:
        """From now on nothing passes, and connections stay open."""
        self._loop.call_soon_threadsafe(self._speaks.clear)

    def speak(self) -> None:
        """Everything passes again, also what came meanwhile."""
        self._loop.call_soon_threadsafe(self._speaks.set)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(OSError, asyncio.CancelledError):
            await self._speaks.wait()
            back_reader, back_writer = await asyncio.open_connection(*self._target)
            await asyncio.gather(self._pass(reader, back_writer), self._pass(back_reader, writer))
        writer.close()

    async def _pass(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            while data := await reader.read(65536):
                await self._speaks.wait()
                writer.write(data)
                await writer.drain()
        finally:
            writer.close()

    def close(self) -> None:
        """Cuts all connections."""
        asyncio.run_coroutine_threadsafe(self._end(), self._loop).result(10)
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(10)
        self._loop.close()

    async def _end(self) -> None:
        self._server.close()
        others = asyncio.all_tasks() - {asyncio.current_task()}
        for task in others:
            task.cancel()
        await asyncio.gather(*others, return_exceptions=True)


@contextmanager
def hushed_proxy(url: str) -> Iterator[HushedProxy]:
    """A proxy in front of a server, which speaks to begin with."""
    proxy = HushedProxy(url)
    try:
        yield proxy
    finally:
        proxy.close()
