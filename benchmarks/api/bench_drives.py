"""Twenty people drive at once: how soon a key moves a machine, and what others of the API wait.

A real API process; each driver holds keys for some seconds over a socket, from one of some loopback
addresses, as one caller may have few drives at once. A light question is asked meanwhile.
"""

import argparse
import asyncio
import itertools
import json
import statistics
import struct
import time
from pathlib import Path
from typing import Any, Final

import httpx
import psutil
from benchmarks.figures import tell
from support.machines.families import car
from support.servers.api_process import api_process
from websockets.asyncio.client import connect

from buildarena_environment.processes import tree_memory_bytes

EACH: Final = 4
"""Drives of one address."""
SWITCH_S: Final = 0.5
MOVED: Final = 1e-3
"""Units that a machine at rest moves before it counts as moving."""
LIGHT: Final = "/v1/tasks"


async def drive(url: str, number: int, seconds: float, engine: str) -> dict[str, Any]:
    """One driver: forwards and backwards in turns."""
    address = f"127.0.0.{2 + number // EACH}"
    latest: dict[str, float] = {}
    reacted, moved, frames = [], 0.0, 0
    began = time.perf_counter()
    socket_url = url.replace("http", "ws") + "/v1/drives"
    async with connect(socket_url, max_size=None, local_addr=(address, 0)) as socket:
        hello = {"machine": car(drive=()).to_document(), "simulator": engine}
        await socket.send(json.dumps(hello))
        json.loads(await socket.recv())
        ready_s = time.perf_counter() - began
        rest = struct.unpack_from("<3f", await socket.recv(), 8)

        async def press() -> None:
            for turn in itertools.count(1):
                held = ["UpArrow"] if turn % 2 else ["DownArrow"]
                latest[str(turn)] = time.perf_counter()
                await socket.send(json.dumps({"held": held, "number": turn}))
                await asyncio.sleep(SWITCH_S)

        pressing = asyncio.create_task(press())
        last = "0"
        async for message in socket:
            now = time.perf_counter()
            if isinstance(message, str):
                continue
            frames += 1
            time_s, turn = struct.unpack_from("<fI", message)
            if (
                not moved
                and max(map(abs, _minus(struct.unpack_from("<3f", message, 8), rest))) > MOVED
            ):
                moved = now - latest["1"]
            if str(turn) != last and str(turn) in latest:
                last = str(turn)
                reacted.append(now - latest[last])
            if time_s >= seconds:
                break
        pressing.cancel()
        took = time.perf_counter() - latest["1"]
    return {"ready": ready_s, "moved": moved, "reacted": reacted, "fps": frames / took}


def _minus(first: tuple[float, ...], second: tuple[float, ...]) -> list[float]:
    return [one - other for one, other in zip(first, second, strict=True)]


async def ask_light(url: str, times: list[float]) -> None:
    """Asks the light question again and again."""
    async with httpx.AsyncClient(base_url=url) as client:
        while True:
            began = time.perf_counter()
            (await client.get(LIGHT)).raise_for_status()
            times.append(time.perf_counter() - began)
            await asyncio.sleep(0.05)


async def measure(url: str, pid: int, drivers: int, seconds: float, engine: str) -> dict[str, Any]:
    """All drivers at once."""
    await drive(url, 0, 0.2, engine)  # the process that others are forked from starts with it
    light: list[float] = []
    asking = asyncio.create_task(ask_light(url, light))
    driving = asyncio.gather(*(drive(url, n, seconds, engine) for n in range(drivers)))
    await asyncio.sleep(seconds / 2)
    memory = sum(tree_memory_bytes(child.pid) for child in psutil.Process(pid).children())
    found = await driving
    asking.cancel()
    reacted = sorted(one for driver in found for one in driver["reacted"])
    moved = sorted(driver["moved"] for driver in found)
    return {
        "drivers": drivers,
        "engine": engine,
        "ready_ms_most": round(1000 * max(driver["ready"] for driver in found)),
        "key_to_frame_ms_p50": round(1000 * statistics.median(reacted)),
        "key_to_frame_ms_p95": round(1000 * reacted[int(0.95 * len(reacted))]),
        "key_to_motion_ms_p50": round(1000 * statistics.median(moved)),
        "key_to_motion_ms_most": round(1000 * moved[-1]),
        "frames_per_s_least": round(min(driver["fps"] for driver in found), 1),
        "light_question_ms_p95": round(1000 * sorted(light)[int(0.95 * len(light))]),
        "memory_mb_each": round(memory / drivers / 1e6),
    }


def main() -> None:
    """Measures one driver, and many."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--drivers", type=int, default=20)
    parser.add_argument("--seconds", type=float, default=20.0)
    asked = parser.parse_args()
    with api_process() as (url, pid):
        figures = [
            asyncio.run(measure(url, pid, drivers, asked.seconds, engine))
            for drivers in (1, asked.drivers)
            for engine in ("pybullet", "mujoco")
        ]
    tell(figures, asked.json)


if __name__ == "__main__":
    main()
