"""A real MCP client builds a bridge over stdio and gets its score."""

import asyncio
import contextlib
import json
import socket
import subprocess

import pytest
from mcp import ClientSession, StdioServerParameters, stdio_client
from mcp.client.streamable_http import streamable_http_client
from support.clients.terminals import BUILDARENA
from support.servers.stacks import wait_until
from support.stages import work

from buildarena_cli.local import free_port
from buildarena_worker.builtin.designs import DESIGNS
from buildarena_worker.wiring import verifier


async def play(connected, simulate) -> dict[str, object]:
    async with connected as (read, write, *_), ClientSession(read, write) as session:
        await session.initialize()
        tools = {tool.name for tool in (await session.list_tools()).tools}
        assert {"open_session", "attach_block_to", "submit"} <= tools
        assert "support-1" in await said(session, "list_tasks", {})
        opened = await said(
            session, "open_session", {"task": "support-1", "agent": "mcp", "simulator": "mujoco"}
        )
        session_id = opened.split()[1]
        assert "gap" in opened
        torch = {"base_block": "1", "face": "A", "new_block": "Torch", "note": ""}
        refused = await session.call_tool("attach_block_to", {"session": session_id, **torch})
        assert refused.is_error
        for name, arguments in DESIGNS["support-1"](0).parts["bridge"].actions:
            await said(session, name, {"session": session_id, **arguments})
        assert "not ended" in await said(session, "submit", {"session": session_id})
        await asyncio.to_thread(simulate)
        wrong = await session.call_tool("get_result", {"session": "job_x"})
        assert wrong.is_error
        missing = await session.call_tool("submit", {})
        assert "missing argument 'session'" in missing.content[0].text
        return json.loads(await said(session, "get_result", {"session": session_id}))


async def said(session: ClientSession, tool: str, arguments: dict[str, object]) -> str:
    result = await session.call_tool(tool, arguments)
    assert not result.is_error, result
    return result.content[0].text


@pytest.fixture
def stdio(url):
    return stdio_client(StdioServerParameters(command=BUILDARENA, args=["mcp", "--url", url]))


@pytest.mark.ci
def test_an_agent_builds_a_bridge_and_gets_its_score(context, stdio) -> None:
    result = asyncio.run(play(stdio, lambda: work(context)))
    assert result["outcome"] == "success"
    assert result["indicator"] > 100
    (job,) = context.store.jobs.page(limit=2)
    report = verifier(context).verify(job.id).as_document()
    assert report["ok"], [check for check in report["checks"] if not check["ok"]]


async def play_against_the_rules(connected) -> dict[str, object]:
    async with connected as (read, write, *_), ClientSession(read, write) as session:
        await session.initialize()
        wanted = {"task": "lift-3", "agent": "mcp", "simulator": "mujoco"}
        opened = await said(session, "open_session", wanted)
        here = {"session": opened.split()[1]}
        part = {"base_block": "1", "face": "A", "new_block": "Small Wooden Block"}
        for machine in ("engine", "frame"):
            await said(session, "start", {**here, "machine": machine})
            await said(session, "attach_block_to", {**here, "machine": machine, **part})
        early = await session.call_tool("submit", here)
        assert early.is_error
        assert "2 machines ('engine', 'frame') and no assembly" in early.content[0].text
        for height, machine in enumerate(("engine", "frame")):
            added = {"machine_id": machine, "init_shift": [0, 0, 2 * height]}
            await said(session, "add_machine", {**here, "machine": "assembly", **added})
        return json.loads(await said(session, "submit", here))


@pytest.mark.ci
def test_an_agent_reads_which_rule_its_machine_breaks(stdio) -> None:
    result = asyncio.run(play_against_the_rules(stdio))
    assert (result["outcome"], result["reason"]) == ("construction_failed", "unjoined_parts")
    assert result["detail"].startswith("sub-structure B is not joined to the starting block A_1")


@pytest.mark.ci
def test_an_agent_builds_over_streamable_http(context, url) -> None:
    port = free_port()
    server = subprocess.Popen([BUILDARENA, "mcp", "--url", url, "--http", str(port)])
    try:
        wait_until(lambda: _answers(port), 60, "the MCP server answers")
        connected = streamable_http_client(f"http://127.0.0.1:{port}/mcp")
        result = asyncio.run(play(connected, lambda: work(context)))
    finally:
        server.terminate()
        server.wait()
    assert result["outcome"] == "success"


def _answers(port: int) -> bool:
    with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), timeout=1):
        return True
    return False


async def side_by_side(connected) -> list[str]:
    async with connected as (read, write), ClientSession(read, write) as session:
        await session.initialize()
        payload = {"task": "support-1", "agent": "mcp"}
        opened = await said(session, "open_session", payload)
        assert await said(session, "open_session", payload) == opened
        ids = {"session": opened.split()[1]}
        await said(session, "start", ids)
        block = {**ids, "face": "E", "new_block": "small wooden block"}
        # Each needs the one before it.
        rows = [{**block, "base_block": str(number)} for number in range(1, 13)]
        results = await asyncio.gather(*(said(session, "attach_block_to", row) for row in rows))
        again = await said(session, "open_session", payload)
        assert "It was open already, and 13 calls were made" in again
        return results


@pytest.mark.ci
def test_calls_sent_side_by_side_are_done_in_the_order_sent(stdio) -> None:
    results = asyncio.run(side_by_side(stdio))
    blocks = [result.split(",")[0] for result in results]
    assert blocks == [f"Attached. {number} Small Wooden Block" for number in range(2, 14)]
