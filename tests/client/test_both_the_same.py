"""Both clients have the same methods, follow the contract and load little; one asks at once."""

import asyncio
import contextlib
import importlib.util
import inspect
import json
import sys
import types
from pathlib import Path
from typing import NotRequired, get_origin, get_type_hints

import pytest
from support.contract import contract
from support.programs import captured
from support.servers.wrong_server import answer, wrong_server

from buildarena_client import AsyncClient, Client, schemas
from buildarena_client.client import run

PROJECT = Path(__file__).parents[2] / "clients" / "python"
CONTRACT = contract()
EMPTY = b'{"data": [], "next_cursor": null}'
METHODS = [name for name, _ in inspect.getmembers(AsyncClient, callable) if name[0] != "_"]
CALLED = {
    "get_artifact": "artifact",
    "get_machine": "machine",
    "get_transcript": "transcript",
    "results": "sweep_results",
    "faults": "sweep_faults",
    "get_trajectory": "trajectory",
    "export": "export_leaderboard",
    "forecast_sweep": "sweep_forecast",
    "stream_job": "job_events",
    "stream_sweep": "sweep_events",
    "summarise_jobs": "job_summary",
    "try_file": "try_machine",
    "verify": "verify_leaderboard",
}
HEAVY = {"httpx", "httpx2", "pandas", "polars", "numpy", "pydantic", "yaml", "anyio", "asyncio"}


def test_each_method_is_in_both_and_takes_the_same() -> None:
    for name in METHODS:
        blocking, awaited = getattr(Client, name), getattr(AsyncClient, name)
        assert inspect.signature(blocking).parameters == inspect.signature(awaited).parameters
        assert inspect.getdoc(blocking) == inspect.getdoc(awaited)
        assert not inspect.iscoroutinefunction(blocking)
        answers = str(inspect.signature(awaited).return_annotation)
        assert inspect.iscoroutinefunction(awaited) or "AsyncGenerator" in answers
    # What the API gains, the client gains; runners, keys and metrics have clients of their own.
    operations = {
        operation["operationId"].removeprefix("list_").removeprefix("show_")
        for path, operations in CONTRACT["paths"].items()
        for operation in operations.values()
        if not path.startswith(("/v1/runner", "/v1/keys", "/v1/metrics"))
    }
    assert {CALLED.get(operation, operation) for operation in operations} - set(METHODS) == set()


def test_a_coroutine_that_suspends_is_refused_without_an_event_loop() -> None:
    @types.coroutine
    def suspends():
        yield

    with pytest.raises(RuntimeError, match="must block"):
        run(suspends())


def test_types_have_the_keys_of_the_contract_and_change_with_it() -> None:
    documents = CONTRACT["components"]["schemas"]
    typed = {name for name in documents if inspect.isclass(getattr(schemas, name, None))}
    assert {"JobDetail", "Sweep", "Board", "ToolOutcome"} <= typed
    for name in typed:
        hints = get_type_hints(getattr(schemas, name), include_extras=True)
        required = {key for key, hint in hints.items() if get_origin(hint) is not NotRequired}
        assert hints.keys() == documents[name]["properties"].keys(), name
        assert required == set(documents[name].get("required", ())), name
    spec = importlib.util.spec_from_file_location("hatch_build", PROJECT / "hatch_build.py")
    build = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(build)
    text = build.module_text(CONTRACT)
    assert text == Path(schemas.__file__).read_text(), "run `make install`"
    changed = json.loads(json.dumps(CONTRACT).replace('"cancelled"', '"stopped"'))
    assert build.module_text(changed) != text


def ran(program: str) -> str:
    command = [sys.executable, "-c", f"import buildarena_client as c\n{program}"]
    done = captured(command)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_nothing_is_loaded_at_once_and_no_event_loop_to_ask() -> None:
    loaded = "print(*{n.split('.')[0] for n in sys.modules})"
    at_once, asking = (
        set(line.split())
        for line in ran(
            f"import sys\n{loaded}\n"
            "try: c.Client('http://127.0.0.1:1').jobs().__next__()\n"
            f"except c.UnreachableError: {loaded}"
        ).splitlines()
    )
    assert at_once & {*HEAVY, "http", "ssl", "urllib"} == set()
    assert asking & {*HEAVY, "buildarena_geometry"} - {"anyio"} == {"httpx2"}


def test_a_library_that_is_missing_is_named_with_its_extra() -> None:
    given = "c.Client('http://x').submit_sweep(pathlib.Path('x'))"
    programs = {"yaml": given, "pandas": "c.jobs_frame([])"}
    programs["polars"] = "c.jobs_frame([], kind='polars')"
    caught = "except c.MissingLibraryError as error: print(error)"
    tries = [f"try: {program}\n{caught}" for program in programs.values()]
    hide = "for name in ('yaml', 'pandas', 'polars'): sys.modules[name] = None"
    told = ran("\n".join(("import sys, pathlib", hide, *tries))).splitlines()
    for extra, line in zip(programs, told, strict=True):
        assert f"buildarena-client[{extra}]" in line


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
                head = b"HTTP/1.1 200 OK\r\nContent-Length: %d\r\n\r\n"
                writer.write(head % len(EMPTY) + EMPTY)
                await writer.drain()
                self.answered += 1
        except (asyncio.IncompleteReadError, ConnectionError):
            pass
        finally:
            writer.close()


@contextlib.asynccontextmanager
async def asking(serve, **given):
    """A client of a server of these answers."""
    listening = await asyncio.start_server(serve, "127.0.0.1", 0)
    url = f"http://127.0.0.1:{listening.sockets[0].getsockname()[1]}"
    async with listening, AsyncClient(url, **given) as client:
        yield client


@pytest.mark.parametrize("at_once", [1, 16])
def test_a_hundred_requests_at_once_are_bounded(at_once) -> None:
    async def ask() -> None:
        server = CountingServer(lasts_s=0.005)
        async with asking(server, at_once=at_once) as client:
            assert await asyncio.gather(*(client.tasks() for _ in range(100))) == [[]] * 100
        assert (server.answered, server.most) == (100, at_once)

    asyncio.run(ask())


def test_whoever_is_cancelled_leaves_its_place_and_sends_nothing_more() -> None:
    async def ask() -> None:
        server = CountingServer(lasts_s=0.2)
        async with asking(server, at_once=2) as client:
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
        assert (server.left, server.answered) == (3, 3)

    async def wait(url: str) -> None:
        async with AsyncClient(url) as client:
            with pytest.raises(TimeoutError):
                async with asyncio.timeout(0.2):
                    await client.tasks()

    asyncio.run(ask())
    with wrong_server(answer(429, Retry_After="1")) as server:
        asyncio.run(wait(server.url))
        assert len(server.received) == 1


def test_a_download_that_is_cancelled_leaves_nothing(tmp_path) -> None:
    async def begin(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.readuntil(b"\r\n\r\n")
        writer.write(b"HTTP/1.1 200 OK\r\nContent-Length: 100\r\n\r\nPK")
        await reader.read()
        writer.close()

    async def ask() -> None:
        async with asking(begin) as client:
            task = asyncio.create_task(client.download("/v1/x", tmp_path / "x.zip"))
            while not list(tmp_path.iterdir()):  # noqa: ASYNC110 - a file tells nobody
                await asyncio.sleep(0.005)
            task.cancel()
            with pytest.raises(asyncio.CancelledError):
                await task

    asyncio.run(ask())
    assert list(tmp_path.iterdir()) == []


def test_a_client_works_in_any_loop_and_over_connections_that_ended() -> None:
    """Whether or not it saw their end: a request that may not be sent twice would be lost."""
    idle = b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\n{}"

    async def ask(client: AsyncClient) -> None:
        for _ in range(2):
            assert await client.call_tool("job_1", "start") == {}

    async def ask_blocking(url: str) -> None:
        # As in a notebook: the synchronous client inside a running loop.
        assert Client(url).call_tool("job_1", "start") == {}

    with wrong_server(idle) as server:
        client = AsyncClient(server.url)
        for _ in range(2):
            asyncio.run(ask(client))
        asyncio.run(client.close())
        asyncio.run(ask_blocking(server.url))
        assert len(server.received) == 5


def test_streams_take_no_place_of_requests(service) -> None:
    async def ask() -> None:
        client = AsyncClient(service.url, at_once=1)
        async with client, contextlib.aclosing(client.sweep_events(service.sweep)) as events:
            async for _ in events:
                assert await client.tasks()
                break

    asyncio.run(ask())
