"""A drive's process, seen from the event loop that owns it."""

from __future__ import annotations

import asyncio
import multiprocessing
from collections import deque
from functools import cache
from multiprocessing.context import BaseContext
from typing import Final

from starlette.concurrency import run_in_threadpool

from buildarena_api.driving.messages import FRAME, NEWS, Keys
from buildarena_api.driving.wheel import Course, serve

MAX_UNHEARD: Final = 50
"""Changes of keys that a process is sent between two frames; the last one always follows."""
LONGEST_END_S: Final = 2.0


@cache
def _processes() -> BaseContext:
    """Forked from a process that has loaded everything and has no threads, where there is one."""
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    processes = multiprocessing.get_context("forkserver")
    processes.set_forkserver_preload(["buildarena_api.driving.preload"])
    return processes


class DriveProcess:
    """One drive's process.

    Args:
        course: What is driven where.
    """

    def __init__(self, course: Course) -> None:
        self._course = course
        self._pipe, self._theirs = multiprocessing.Pipe()
        self._process = _processes().Process(  # type: ignore[attr-defined]
            target=serve, args=(self._theirs, course), name="drive", daemon=True
        )
        self._news: deque[bytes] = deque()
        self._frame: bytes | None = None
        self._arrived = asyncio.Event()
        self._is_over = False
        self._unheard = 0
        self._pending: Keys | None = None

    async def start(self) -> None:
        """Starts it; the first one takes some seconds."""
        await run_in_threadpool(self._process.start)
        self._theirs.close()
        asyncio.get_running_loop().add_reader(self._pipe.fileno(), self._read)

    async def next(self) -> bytes | None:
        """What it says next, news before frames; of frames the last one. None once it has ended."""
        while not self._news and self._frame is None:
            if self._is_over:
                return None
            self._arrived.clear()
            await self._arrived.wait()
        if self._news:
            return self._news.popleft()
        frame, self._frame = self._frame, None
        return frame

    def hold(self, keys: Keys) -> None:
        """Tells it which keys are held."""
        if self._unheard >= MAX_UNHEARD:
            self._pending = keys
        else:
            self._send(keys)

    async def close(self) -> None:
        """Ends it at once."""
        asyncio.get_running_loop().remove_reader(self._pipe.fileno())
        self._pipe.close()
        if self._process.pid is not None:
            await run_in_threadpool(self._end)

    def _end(self) -> None:
        self._process.kill()
        self._process.join(LONGEST_END_S)

    def _send(self, keys: Keys) -> None:
        self._unheard += 1
        try:
            self._pipe.send_bytes(keys.model_dump_json().encode())
        except OSError:
            self._finish()

    def _read(self) -> None:
        try:
            while self._pipe.poll():
                message = self._pipe.recv_bytes()
                if message.startswith(NEWS):
                    self._news.append(message)
                elif message.startswith(FRAME):
                    self._frame, self._unheard = message, 0
        except (EOFError, OSError):
            self._finish()
        self._arrived.set()
        if self._pending is not None and not self._unheard:
            keys, self._pending = self._pending, None
            self._send(keys)

    def _finish(self) -> None:
        self._is_over = True
        asyncio.get_running_loop().remove_reader(self._pipe.fileno())
        self._arrived.set()
