"""Clients that mean no good get errors, and the others' episodes go on."""

from __future__ import annotations

import asyncio
import json
from contextlib import AsyncExitStack

import httpx
import psutil
import pytest
import websockets

from buildarena_environment import LONGEST_CALL
from buildarena_openenv import BuildAction, BuildClient

pytestmark = pytest.mark.nightly

START = {"type": "step", "data": {"tool": "start", "arguments": {}}}


def run(server, play) -> None:
    """Plays against a server on which an honest client builds before and after."""

    async def both() -> None:
        async with BuildClient(base_url=server[0]) as honest:
            await honest.reset(task="support-1")
            await honest.step(BuildAction(tool="start"))
            await play(server[0].replace("http", "ws") + "/ws")
            assert (await honest.state()).machines == {"main": 1}
            block = {"base_block": "1", "face": "A", "new_block": "Small Wooden Block"}
            done = await honest.step(BuildAction(tool="attach_block_to", arguments=block))
            assert done.observation.accepted

    asyncio.run(both())


async def said(socket, message) -> dict:
    await socket.send(message if isinstance(message, str) else json.dumps(message))
    return json.loads(await asyncio.wait_for(socket.recv(), 20))


@pytest.mark.parametrize(
    ("data", "problem"),
    [
        ({}, "tool"),
        ({"tool": 7}, "tool"),
        ({"tool": "x" * 101}, "tool"),
        ({"tool": "start", "arguments": []}, "arguments"),
        ({"tool": "start", "arguments": {"note": "x" * LONGEST_CALL}}, "arguments"),
        ({"tool": "start", "machine": "main"}, "machine"),
        ({"tool": "start", "metadata": {"x": "y" * LONGEST_CALL}}, "metadata"),
    ],
)
def test_a_malformed_call_is_an_error_that_names_the_place(server, data, problem) -> None:
    async def play(url: str) -> None:
        async with websockets.connect(url) as socket:
            answer = await said(socket, {"type": "step", "data": data})
            assert answer["type"] == "error"
            assert answer["data"]["code"] == "VALIDATION_ERROR"
            assert problem in answer["data"]["errors"][0]["loc"]
            assert (await said(socket, START))["data"]["observation"]["accepted"]

    run(server, play)


@pytest.mark.parametrize(
    "data",
    [
        {"tool": "no such tool"},
        {"tool": "attach_block_to", "arguments": {"base_block": None, "face": {}}},
        {"tool": "attach_block_to", "arguments": {"\u0000": [[[[1e308]]]]}},
        {"tool": "start", "arguments": {"machine": "../../etc"}},
        {"tool": "start", "arguments": {"machine": 5}},
        {"tool": "submit", "arguments": {"now": 1}},
    ],
)
def test_a_call_that_makes_no_sense_is_refused(server, data) -> None:
    async def play(url: str) -> None:
        async with websockets.connect(url) as socket:
            answer = await said(socket, {"type": "step", "data": data})
            assert answer["data"]["observation"]["accepted"] is False
            assert answer["data"]["observation"]["text"]
            assert answer["data"]["done"] is False

    run(server, play)


@pytest.mark.parametrize(
    ("settings", "problem"),
    [
        ({"task": "support-9"}, "no task 'support-9'"),
        ({"task": ["support-1"]}, "task is a name"),
        ({"steps": 301}, "from 1 to 300"),
        ({"steps": 0}, "from 1 to 300"),
        ({"steps": True}, "from 1 to 300"),
        ({"rounds": 11}, "from 1 to 10"),
        ({"rounds": "2"}, "from 1 to 10"),
        ({"seed": -1}, "seed"),
        ({"seed": 2**80}, "seed"),
        ({"episode_id": "x" * 256}, "episode_id"),
        ({"simulator": "pybullet"}, "no setting 'simulator'"),
    ],
)
def test_a_reset_is_bounded(server, settings, problem) -> None:
    async def play(url: str) -> None:
        async with websockets.connect(url) as socket:
            answer = await said(socket, {"type": "reset", "data": settings})
            assert answer["type"] == "error"
            assert problem in json.dumps(answer)

    run(server, play)


@pytest.mark.parametrize(
    "message", ["", "not JSON", "[]", "[" * 50_000, '{"type": "fly"}', '{"type": []}', "7"]
)
def test_what_is_no_message_is_answered_with_an_error(server, message) -> None:
    async def play(url: str) -> None:
        async with websockets.connect(url) as socket:
            assert (await said(socket, message))["type"] == "error"

    run(server, play)


def test_a_huge_message_is_not_read(server) -> None:
    async def play(url: str) -> None:
        async with websockets.connect(url) as socket:
            with pytest.raises(websockets.ConnectionClosed) as closed:
                await said(socket, json.dumps({"type": "step", "data": {"tool": "x" * 300_000}}))
            assert closed.value.rcvd.code == 1009

    run(server, play)


def test_a_huge_request_is_not_read(server) -> None:
    def pieces():
        for _ in range(100):
            yield b" " * 100_000

    for content in (b'{"action": {"tool": "' + b"x" * 300_000 + b'"}}', pieces()):
        try:
            answer = httpx.post(f"{server[0]}/step", content=content, timeout=20)
        except httpx.TransportError:  # it was closed while more was sent
            continue
        assert answer.status_code == 413
    small = httpx.post(f"{server[0]}/step", json={"action": {"tool": "start"}}, timeout=20)
    assert small.json()["observation"]["accepted"]


def test_too_many_sessions_are_refused_and_leaving_makes_room(server) -> None:
    async def play(url: str) -> None:
        async with AsyncExitStack() as stack:
            sockets = [await stack.enter_async_context(websockets.connect(url)) for _ in range(11)]
            for socket in sockets:
                assert (await said(socket, START))["data"]["observation"]["accepted"]
            async with websockets.connect(url) as late:
                refused = json.loads(await asyncio.wait_for(late.recv(), 20))
            assert refused["data"]["code"] == "CAPACITY_REACHED"
        for _ in range(100):
            async with websockets.connect(url) as socket:
                await socket.send(json.dumps(START))
                answer = json.loads(await asyncio.wait_for(socket.recv(), 20))
            if answer["type"] != "error":
                break
            await asyncio.sleep(0.1)
        assert answer["data"]["observation"]["accepted"]

    run(server, play)


def test_a_session_holds_a_bounded_episode(server) -> None:
    """Machines by the hundred and resets by the dozen leave the server as large as it was."""

    async def play(url: str) -> None:
        process = psutil.Process(server[1].pid)
        async with websockets.connect(url) as socket:
            sizes = []
            for _ in range(4):
                await said(socket, {"type": "reset", "data": {}})
                for number in range(298):
                    name = {"machine": f"m{number}"}
                    await said(
                        socket, {"type": "step", "data": {"tool": "start", "arguments": name}}
                    )
                state = await said(socket, {"type": "state"})
                assert len(state["data"]["machines"]) == 298
                sizes.append(process.memory_info().rss)
            assert sizes[-1] - sizes[1] < 30e6
            await said(socket, START)
            last = await said(socket, START)
            assert last["data"]["observation"]["truncated"]

    run(server, play)
