"""A real MCP client builds a bridge over stdio and over HTTP, and gets its score."""

import asyncio
import contextlib
import json
import socket
import subprocess
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest
from mcp import ClientSession, StdioServerParameters, stdio_client
from mcp.client.streamable_http import streamable_http_client
from support.clients.terminals import BUILDARENA
from support.servers.stacks import wait_until
from support.stages import assert_verified, work

from buildarena_benchmark.experts import expert_designs
from buildarena_cli.local.server import free_port

WANTED = {"task": "support-1", "agent": "mcp", "simulator": "mujoco"}
BLOCK = {"base_block": "1", "face": "A", "new_block": "Small Wooden Block"}


@asynccontextmanager
async def connected(transport) -> AsyncIterator[ClientSession]:
    async with transport as (read, write, *_), ClientSession(read, write) as session:
        await session.initialize()
        yield session


async def said(session: ClientSession, tool: str, arguments: dict[str, object]) -> str:
    result = await session.call_tool(tool, arguments)
    assert not result.is_error, result
    return result.content[0].text


async def refused(session: ClientSession, tool: str, arguments: dict[str, object]) -> str:
    result = await session.call_tool(tool, arguments)
    assert result.is_error
    return result.content[0].text


async def play(transport, simulate) -> dict[str, object]:
    async with connected(transport) as session:
        tools = {tool.name for tool in (await session.list_tools()).tools}
        assert {"open_session", "attach_block_to", "submit"} <= tools
        assert "support-1" in await said(session, "list_tasks", {})
        opened = await said(session, "open_session", WANTED)
        assert "gap" in opened
        here = {"session": opened.split()[1]}
        await refused(session, "attach_block_to", {**here, **BLOCK, "new_block": "Torch"})
        for name, arguments in expert_designs()["support-1"](0).parts["bridge"].actions:
            await said(session, name, {**here, **arguments})
        assert "not ended" in await said(session, "submit", here)
        await asyncio.to_thread(simulate)
        await refused(session, "get_result", {"session": "job_x"})
        assert "missing argument 'session'" in await refused(session, "submit", {})
        return json.loads(await said(session, "get_result", here))


@pytest.fixture
def stdio(url):
    return stdio_client(StdioServerParameters(command=BUILDARENA, args=["mcp", "--url", url]))


@pytest.fixture
def http(url):
    port = free_port()
    server = subprocess.Popen([BUILDARENA, "mcp", "--url", url, "--http", str(port)])

    def answers() -> bool:
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), timeout=1):
            return True
        return False

    try:
        wait_until(answers, 60, "the MCP server answers")
        yield streamable_http_client(f"http://127.0.0.1:{port}/mcp")
    finally:
        server.terminate()
        server.wait()


@pytest.mark.ci
@pytest.mark.parametrize("transport", ["stdio", "http"])
def test_an_agent_builds_a_bridge_and_gets_its_score(context, request, transport) -> None:
    connection = request.getfixturevalue(transport)
    result = asyncio.run(play(connection, lambda: work(context)))
    assert result["outcome"] == "success"
    assert [text.partition(".")[0] for text in result["worlds"]] == ["Exact world: passed"]
    assert result["indicator"] > 100
    (job,) = context.store.jobs.page(limit=2)
    assert_verified(context, job.id)


@pytest.mark.ci
def test_calls_are_done_in_the_order_sent_and_rules_are_told(stdio) -> None:
    async def build() -> tuple[list[str], dict[str, object]]:
        async with connected(stdio) as session:
            opened = await said(session, "open_session", WANTED)
            assert await said(session, "open_session", WANTED) == opened
            here = {"session": opened.split()[1]}
            await said(session, "start", here)
            # Each needs the one before it.
            rows = [{**here, **BLOCK, "face": "E", "base_block": str(n)} for n in range(1, 13)]
            made = await asyncio.gather(*(said(session, "attach_block_to", row) for row in rows))
            again = await said(session, "open_session", WANTED)
            assert "It was open already, and 13 calls were made" in again

            opened = await said(session, "open_session", {**WANTED, "task": "lift-3"})
            here = {"session": opened.split()[1]}
            for machine in ("engine", "frame"):
                await said(session, "start", {**here, "machine": machine})
                await said(session, "attach_block_to", {**here, "machine": machine, **BLOCK})
            early = await refused(session, "submit", here)
            assert "2 machines ('engine', 'frame') and no assembly" in early
            for height, machine in enumerate(("engine", "frame")):
                added = {"machine_id": machine, "init_shift": [0, 0, 2 * height]}
                await said(session, "add_machine", {**here, "machine": "assembly", **added})
            return made, json.loads(await said(session, "submit", here))

    made, result = asyncio.run(build())
    blocks = [text.split(",")[0] for text in made]
    assert blocks == [f"Attached. {number} Small Wooden Block" for number in range(2, 14)]
    assert (result["outcome"], result["reason"]) == ("construction_failed", "unjoined_parts")
    assert result["detail"].startswith("sub-structure B is not joined to the starting block A_1")
