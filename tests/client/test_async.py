"""What only the asynchronous client does: many requests at once, and being cancelled."""

import asyncio
import contextlib

import pytest
from support.servers.wrong_server import answer, wrong_server

from buildarena_client import AsyncClient, Client

SWEEP = "sweep_0a1b2c3d4e5f60718293"


class CountingServer:
    """Answers each request after a moment, and counts those that are open."""

    def __init__(self, *, lasts_s: float) -> None:
        self._lasts_s = lasts_s
        self.open = self.most = self.answered = self.left = 0

    async def __call__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            while await reader.readuntil(b"\r\n\r\n"):
                self.open += 1
                self.most = max(self.most, self.open)
                gone = asyncio.create_task(reader.read(1))
                done, _ = await asyncio.wait({gone}, timeout=self._lasts_s)
                self.open -= 1
                if done:
                    self.left += 1
                    return
                gone.cancel()
                with contextlib.suppress(asyncio.CancelledError):
                    await gone
                writer.write(b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\n[]")
                await writer.drain()
                self.answered += 1
        except (asyncio.IncompleteReadError, ConnectionError):
            pass
        finally:
            writer.close()


@contextlib.asynccontextmanager
async def serving(server: CountingServer):
    """The URL of a server."""
    listening = await asyncio.start_server(server, "127.0.0.1", 0)
    async with listening:
        yield f"http://127.0.0.1:{listening.sockets[0].getsockname()[1]}"


@pytest.mark.parametrize("at_once", [1, 4, 16])
def test_a_hundred_requests_at_once_are_bounded(at_once) -> None:
    async def ask() -> CountingServer:
        server = CountingServer(lasts_s=0.005)
        async with serving(server) as url, AsyncClient(url, at_once=at_once) as client:
            answers = await asyncio.gather(*(client.tasks() for _ in range(100)))
        assert answers == [[]] * 100
        return server

    server = asyncio.run(ask())
    assert server.answered == 100
    assert server.most == at_once


@pytest.mark.ci
def test_a_hundred_requests_at_once_to_the_service(service) -> None:
    async def ask() -> list[str]:
        async with AsyncClient(service.url) as client:
            wanted = [service.jobs[n % len(service.jobs)] for n in range(100)]
            found = await asyncio.gather(*(client.job(id_) for id_ in wanted))
        assert [job["id"] for job in found] == wanted

    asyncio.run(ask())


def test_who_is_cancelled_leaves_and_gives_the_place_to_others() -> None:
    async def ask() -> CountingServer:
        server = CountingServer(lasts_s=0.2)
        async with serving(server) as url, AsyncClient(url, at_once=2) as client:
            tasks = [asyncio.create_task(client.tasks()) for _ in range(5)]
            while server.open < 2:  # noqa: ASYNC110 - the server is a test's own
                await asyncio.sleep(0.005)
            for task in tasks:
                task.cancel()
            done = await asyncio.gather(*tasks, return_exceptions=True)
            assert all(isinstance(one, asyncio.CancelledError) for one in done)
            assert await client.tasks() == []
            with pytest.raises(TimeoutError):
                async with asyncio.timeout(0.05):
                    await client.tasks()
            assert await asyncio.gather(client.tasks(), client.tasks()) == [[], []]
        return server

    server = asyncio.run(ask())
    assert (server.left, server.answered) == (3, 3)


def test_who_is_cancelled_while_it_waits_sends_nothing_more() -> None:
    async def ask(url: str) -> None:
        async with AsyncClient(url) as client:
            with pytest.raises(TimeoutError):
                async with asyncio.timeout(0.2):
                    await client.tasks()

    with wrong_server(answer(429, Retry_After="1")) as server:
        asyncio.run(ask(server.url))
        assert len(server.received) == 1


def test_a_download_that_is_cancelled_leaves_nothing(tmp_path) -> None:
    async def begin(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.readuntil(b"\r\n\r\n")
        writer.write(b"HTTP/1.1 200 OK\r\nContent-Length: 100\r\n\r\nPK")
        await reader.read()
        writer.close()

    async def ask() -> None:
        listening = await asyncio.start_server(begin, "127.0.0.1", 0)
        url = f"http://127.0.0.1:{listening.sockets[0].getsockname()[1]}"
        async with listening, AsyncClient(url) as client:
            task = asyncio.create_task(client.download("/v1/x", tmp_path / "x.zip"))
            while not list(tmp_path.iterdir()):  # noqa: ASYNC110 - a file tells nobody
                await asyncio.sleep(0.005)
            task.cancel()
            with pytest.raises(asyncio.CancelledError):
                await task

    asyncio.run(ask())
    assert list(tmp_path.iterdir()) == []


def test_streams_take_no_place_of_requests(service) -> None:
    async def ask() -> None:
        async with (
            AsyncClient(service.url, at_once=1) as client,
            contextlib.aclosing(client.sweep_events(service.sweep)) as events,
        ):
            async for _ in events:
                assert await client.tasks()
                break

    asyncio.run(ask())


def test_a_connection_that_the_server_closed_meanwhile_is_not_used_again() -> None:
    """Whether or not the client saw it: a request that may not be sent twice would be lost."""
    idle = b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\n{}"

    async def ask(url: str) -> None:
        async with AsyncClient(url) as client:
            for _ in range(3):
                assert await client.call_tool("job_1", "start") == {}
                await asyncio.sleep(0.05)

    with wrong_server(idle) as server:
        asyncio.run(ask(server.url))
        assert len(server.received) == 3


def test_a_client_works_in_one_loop_after_another() -> None:
    with wrong_server(answer(200, b"[]")) as server:
        client = AsyncClient(server.url)
        for _ in range(2):
            assert asyncio.run(client.tasks()) == []
        asyncio.run(client.close())


def test_the_synchronous_client_answers_inside_a_running_loop() -> None:
    """As in a notebook."""

    async def ask(url: str) -> list[int]:
        client = Client(url)
        assert client.tasks() == []
        return [sweep["id"] for sweep in client.sweeps(limit=1)]

    page = b'{"next_cursor": "x", "sweeps": [{"id": 1}, {"id": 2}]}'
    with wrong_server(answer(200, b"[]"), answer(200, page)) as server:
        assert asyncio.run(ask(server.url)) == [1]
        assert len(server.received) == 2
