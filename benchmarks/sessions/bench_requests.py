"""What a model request costs over aiohttp and over httpx2, by how many are under way at once.

A stand-in on loopback answers after 50 ms; processor time is this process's, without writing and
reading conversations. Prints its figures as JSON.
"""

import argparse
import asyncio
import json
import multiprocessing
import time
from collections.abc import Awaitable, Callable
from contextlib import AsyncExitStack
from itertools import cycle
from multiprocessing.connection import Connection
from pathlib import Path

import aiohttp
import httpx2
from benchmarks.figures import tell

QUESTION = json.dumps({"messages": [{"role": "user", "content": "x" * 400}] * 60}).encode()
ANSWER = json.dumps({"choices": [{"message": {"content": "y" * 600}}]}).encode()
HEAD = b"HTTP/1.1 200 OK\r\nContent-Type: application/json\r\nContent-Length: %d\r\n\r\n"
ANSWER_S = 0.05
POOL = 25
"""Connections of each client, where httpx2's are shared out."""

Ask = Callable[[], Awaitable[bytes]]


async def _answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    try:
        while True:
            head = await reader.readuntil(b"\r\n\r\n")
            length = head.lower().partition(b"content-length:")[2].partition(b"\r\n")[0]
            await reader.readexactly(int(length))
            await asyncio.sleep(ANSWER_S)
            writer.write(HEAD % len(ANSWER) + ANSWER)
            await writer.drain()
    except (asyncio.IncompleteReadError, ConnectionError):
        writer.close()


def _serve(told: Connection) -> None:
    async def serve() -> None:
        server = await asyncio.start_server(_answer, "127.0.0.1", 0, backlog=2000)
        told.send(server.sockets[0].getsockname()[1])
        await server.serve_forever()

    asyncio.run(serve())


async def _over_aiohttp(url: str, _: int, stack: AsyncExitStack) -> Ask:
    session = await stack.enter_async_context(
        aiohttp.ClientSession(
            connector=aiohttp.TCPConnector(limit=0), cookie_jar=aiohttp.DummyCookieJar()
        )
    )

    async def ask() -> bytes:
        async with session.post(url, data=QUESTION, allow_redirects=False) as answer:
            return await answer.read()

    return ask


async def _over_httpx2(url: str, _: int, stack: AsyncExitStack) -> Ask:
    return await _over_clients(url, 1, stack)


async def _over_httpx2_shared_out(url: str, at_once: int, stack: AsyncExitStack) -> Ask:
    return await _over_clients(url, max(1, at_once // POOL), stack)


async def _over_clients(url: str, count: int, stack: AsyncExitStack) -> Ask:
    limits = httpx2.Limits(max_connections=None, max_keepalive_connections=None)
    clients = [
        await stack.enter_async_context(httpx2.AsyncClient(limits=limits, timeout=60))
        for _ in range(count)
    ]
    turns = cycle(clients)

    async def ask() -> bytes:
        return (await next(turns).post(url, content=QUESTION)).content

    return ask


WAYS = {
    "aiohttp": _over_aiohttp,
    "httpx2": _over_httpx2,
    f"httpx2, {POOL} connections a client": _over_httpx2_shared_out,
}


async def _measured(way: str, url: str, at_once: int, requests: int) -> dict[str, float]:
    async with AsyncExitStack() as stack:
        ask = await WAYS[way](url, at_once, stack)
        left = iter(range(requests))

        async def askers_turn() -> None:
            for _ in left:
                assert await ask() == ANSWER

        await asyncio.gather(*(ask() for _ in range(at_once)))  # connects
        began, used = time.perf_counter(), time.process_time()
        await asyncio.gather(*(askers_turn() for _ in range(at_once)))
        used, took = time.process_time() - used, time.perf_counter() - began
    return {"processor_ms": round(1000 * used / requests, 2), "wall_s": round(took, 1)}


def main() -> None:
    """Runs the benchmark and prints its figures."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--requests", type=int, default=4000)
    parser.add_argument("--json", type=Path, help="also write the figures to this file")
    given = parser.parse_args()
    ours, theirs = multiprocessing.get_context("spawn").Pipe()
    server = multiprocessing.get_context("spawn").Process(
        target=_serve, args=(theirs,), daemon=True
    )
    server.start()
    try:
        url = f"http://127.0.0.1:{ours.recv()}/v1/chat/completions"
        figures = {
            f"{at_once} at once, {way}": asyncio.run(_measured(way, url, at_once, given.requests))
            for at_once in (20, 200, 1000)
            for way in WAYS
        }
    finally:
        server.terminate()
    tell(figures, given.json)


if __name__ == "__main__":
    main()
