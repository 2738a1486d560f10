"""A reverse proxy in front of a service: passes bytes on as they come, and says who sent them."""

import asyncio
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from urllib.parse import urlsplit

PIECE = 65_536
QUIET_ROUNDS = 20
SERVING: set[asyncio.Task[None] | None] = set()
"""Connections under way: of one whose client has left, the loop holds no reference."""


@dataclass(frozen=True, kw_only=True)
class ProxyRules:
    """What a proxy does with requests.

    Attributes:
        prefix: Path below which it shows the service; others get 404.
        cuts: Whether it cuts the prefix off before it passes a request on.
        headers: What it sets, in place of what a client sent by these names.
    """

    prefix: str = ""
    cuts: bool = False
    headers: dict[str, str] = field(default_factory=dict)


@contextmanager
def reverse_proxy(upstream: str, rules: ProxyRules) -> Iterator[str]:
    """Runs one in a thread; yields its URL with the prefix."""
    loop = asyncio.new_event_loop()
    target = urlsplit(upstream)
    serving = asyncio.start_server(
        lambda reader, writer: _serve(reader, writer, (target.hostname, target.port), rules),
        "127.0.0.1",
        0,
    )
    server = loop.run_until_complete(serving)
    thread = threading.Thread(target=loop.run_forever)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.sockets[0].getsockname()[1]}{rules.prefix}"
    finally:
        asyncio.run_coroutine_threadsafe(_stop(server), loop).result(10)
        loop.call_soon_threadsafe(loop.stop)
        thread.join()
        loop.close()


async def _stop(server: asyncio.Server) -> None:
    server.close()
    # A connection that was accepted just now has its task some rounds of the loop later.
    quiet_rounds = 0
    while quiet_rounds < QUIET_ROUNDS:
        others = asyncio.all_tasks() - {asyncio.current_task()}
        for task in others:
            task.cancel()
        await asyncio.gather(*others, return_exceptions=True)
        await asyncio.sleep(0)
        quiet_rounds = 0 if others else quiet_rounds + 1
    await asyncio.sleep(0.05)


async def _serve(
    reader: asyncio.StreamReader,
    writer: asyncio.StreamWriter,
    target: tuple[str | None, int | None],
    rules: ProxyRules,
) -> None:
    """One connection carries one request, so that only heads need to be read."""
    inner: asyncio.StreamWriter | None = None
    task = asyncio.current_task()
    SERVING.add(task)
    try:
        head = await reader.readuntil(b"\r\n\r\n")
        passed = _passed_on(head.decode("latin-1"), rules)
        if passed is None:
            writer.write(
                b"HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\nConnection: close\r\n\r\n"
            )
            await writer.drain()
            return
        answers, inner = await asyncio.open_connection(*target)
        inner.write(passed.encode("latin-1"))
        sending = asyncio.create_task(_pump(reader, inner))
        await _pump(answers, writer)
        sending.cancel()
    except (OSError, asyncio.IncompleteReadError, asyncio.CancelledError):
        # The proxy stops, or an end has left: asyncio would log either.
        pass
    finally:
        for end in (inner, writer):
            if end is not None:
                end.close()
        SERVING.discard(task)


def _passed_on(head: str, rules: ProxyRules) -> str | None:
    first, *lines = head.removesuffix("\r\n\r\n").split("\r\n")
    method, path, version = first.split(" ")
    if path.split("?")[0] != rules.prefix and not path.startswith(f"{rules.prefix}/"):
        return None
    if rules.cuts:
        path = path.removeprefix(rules.prefix) or "/"
    given = [line.partition(":")[::2] for line in lines]
    ours = {name.lower() for name in rules.headers} | {"connection"}
    kept = [f"{name}:{value}" for name, value in given if name.lower() not in ours]
    more = {**rules.headers, "Connection": "close"}
    return "\r\n".join(
        [f"{method} {path} {version}", *kept, *(f"{n}: {v}" for n, v in more.items()), "", ""]
    )


async def _pump(source: asyncio.StreamReader, target: asyncio.StreamWriter) -> None:
    with suppress(OSError):
        while piece := await source.read(PIECE):
            target.write(piece)
            await target.drain()
