"""An MCP client that knows nothing but what the server sends builds three machines."""

import asyncio
import json
import re
import sys
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

import pytest
from mcp import ClientSession, StdioServerParameters, stdio_client
from support.clients.newcomer import Newcomer
from support.servers.live_api import live_api
from support.stages import work

from buildarena_worker.wiring import verifier

BUILDARENA = str(Path(sys.executable).parent / "buildarena")
SIDES = ("East", "West", "North", "South")


async def build_bridge(player: Newcomer) -> None:
    """Seven blocks in a row, with braces that overlap above and below."""
    wood, brace = player.module("usual part of frames"), player.module("rigid strut")
    middle = await player.start()
    ahead = await player.row(middle, "North", 3, wood)
    behind = await player.row(middle, "South", 3, wood)
    row = [*reversed(behind), middle, *ahead]
    for first, second in zip(row, row[4:], strict=False):
        for side in ("Up", "Down"):
            await player.join((first, side), (second, side), brace)


async def build_car(player: Newcomer) -> None:
    """A spine with a wheel at each of four ends, that all roll north on one key."""
    wood, wheel = player.module("usual part of frames"), player.module("motor wheel")
    middle = await player.start()
    key = player.keys()[0]
    for way in ("North", "South"):
        end = (await player.row(middle, way, 2, wood))[-1]
        for side in ("East", "West"):
            (outer,) = await player.row(end, side, 1, wood)
            block, text = await player.attach(outer, side, wheel)
            if "rolls it <North>" not in text:
                await player.use("Reverses the direction a wheel", {"Id of the wheel": block})
            await player.use(
                "Binds a key to an action of a block, in place",
                {
                    "Id of the block": block,
                    "The block's action": player.action(wheel, "forward"),
                    "The key.": key,
                },
            )
    await player.use(
        "Adds one or several key presses",
        {"goes down": 1, "A key that some": key, "stays down": 20},
    )


async def build_rocket(player: Newcomer, reply: str) -> None:
    """An engine of four heated cannons under a frame, joined by braces."""
    wood, brace = player.module("usual part of frames"), player.module("rigid strut")
    cannon, torch = player.module("sprays water"), player.module("flame on a shaft")
    (assembly,) = re.findall(r"joined in the machine `(\w+)`", reply)
    player.machine = "engine"
    middle = await player.start()
    for side in SIDES:
        block, text = await player.attach(middle, side, cannon)
        await player.turn_until(block, "points <Down>", text)
    low = (await player.row(middle, "Down", 2, wood))[-1]
    for side in SIDES:
        block, text = await player.attach(low, side, torch)
        await player.turn_until(block, "points <Up>", text)
        assert "heats " in text
    assert "not heated" not in await player.use("Lists the parts", {})
    player.machine = "frame"
    middle = await player.start()
    for side in SIDES:
        await player.row(middle, side, 2, wood)
    player.machine = assembly
    roots = []
    for part, height in (("frame", 2), ("engine", 0)):
        text = await player.use(
            "Adds a copy", {"Name of the finished": part, "from where it was built": [0, 0, height]}
        )
        (first,) = re.findall(r"blocks (\S+) to", text)
        roots.append(first)
    for side in SIDES:
        await player.join((roots[0], side), (roots[1], "Up"), brace)


async def play(url: str, simulate: Callable[[], None]) -> dict[str, dict[str, object]]:
    server = StdioServerParameters(command=BUILDARENA, args=["mcp", "--url", url])
    results = {}
    async with stdio_client(server) as (read, write), ClientSession(read, write) as session:
        greeting = await session.initialize()
        assert greeting.server_info.version == version("buildarena-cli")
        for title in ("bridge over a gap of 5", "drives and steers", "engine and frame"):
            player = await Newcomer.met(session)
            reply = await player.open(title, simulator=1)
            if title.startswith("bridge"):
                await build_bridge(player)
            elif title.startswith("drives"):
                await build_car(player)
            else:
                await build_rocket(player, reply)
            player.machine = ""
            await player.use("End the building", {})
            await asyncio.to_thread(simulate)
            results[title] = json.loads(await player.use("Read how the session", {}))
    return results


@pytest.mark.nightly
def test_who_knows_only_what_the_server_sends_builds_bridge_car_and_rocket(context) -> None:
    with live_api(context) as url:
        results = asyncio.run(play(url, lambda: work(context)))
    assert {title: result["outcome"] for title, result in results.items()} == dict.fromkeys(
        results, "success"
    )
    jobs = context.store.jobs.page(limit=4)
    assert [job.refused_actions for job in jobs] == [0, 0, 0]
    report = verifier(context).verify(jobs[0].id).as_document()
    assert report["ok"], [check for check in report["checks"] if not check["ok"]]
