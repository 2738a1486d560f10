"""Running stacks for end-to-end tests."""

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import httpx
import psutil

from buildarena_backend.settings import Settings
from buildarena_cli.local.server import free_port
from buildarena_cli.local.stack import Stack


def wait_until(condition: Callable[[], Any], within_s: float, what: str) -> Any:
    """Waits until a condition holds and returns its value."""
    deadline = time.monotonic() + within_s
    while not (value := condition()):
        assert time.monotonic() < deadline, f"not within {within_s} s: {what}"
        time.sleep(0.05)
    return value


@contextmanager
def meanwhile(do: Callable[[], object], *, every_s: float) -> Iterator[None]:
    """Does something again and again in a thread, beside what is done inside."""
    ended = threading.Event()

    def run() -> None:
        while not ended.wait(every_s):
            do()

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


@contextmanager
def running_stack(
    folder: Path, *, simulators: Sequence[str] = ("mujoco",), **settings: Any
) -> Iterator[Stack]:
    """A whole service in a folder; its processes are gone afterwards."""
    usual = {"data": folder / "data", "port": free_port(), "lease_s": 3.0}
    stack = Stack(Settings(**{**usual, **settings}), simulators=simulators)
    before = _children()
    with stack:
        yield stack
    assert _children() <= before


def _children() -> set[tuple[int, str]]:
    """Processes of ours that this one has, however deep."""
    found = {(p.pid, _words(p)) for p in psutil.Process().children(recursive=True)}
    return {(pid, words) for pid, words in found if "buildarena" in words}


def _words(process: psutil.Process) -> str:
    try:
        return " ".join(process.cmdline())
    except psutil.Error:
        return ""


def processes_of(stack: Stack, name: str) -> list[psutil.Process]:
    """A process of a stack with its children, by the name that its supervisor has for it."""
    (managed,) = [each for each in stack.supervisor.managed if each.name == name]
    assert managed.process is not None
    first = psutil.Process(managed.process.pid)
    return [first, *first.children(recursive=True)]


def kill(stack: Stack, name: str) -> None:
    """Ends a process with its children; who watches over it starts it again."""
    with suppress(psutil.NoSuchProcess):
        for process in processes_of(stack, name):
            with suppress(psutil.NoSuchProcess):
                process.kill()


def finished(client: httpx.Client, sweep_id: str, within_s: float = 180) -> dict[str, Any]:
    """The sweep, once every job has ended."""

    def ended() -> dict[str, Any] | None:
        try:
            sweep: dict[str, Any] = client.get(f"/v1/sweeps/{sweep_id}").json()
        except httpx.TransportError:
            return None
        progress = sweep.get("progress")
        return sweep if progress and progress["done"] == progress["total"] else None

    result: dict[str, Any] = wait_until(ended, within_s, f"{sweep_id} ended")
    return result


def results(client: httpx.Client, sweep_id: str) -> list[dict[str, Any]]:
    """Everything that must be equal between two runs of one sweep."""
    jobs = client.get("/v1/jobs", params={"sweep": sweep_id, "limit": 200}).json()["data"]
    found = []
    for job in sorted(jobs, key=lambda job: job["id"]):
        detail = client.get(f"/v1/jobs/{job['id']}").json()
        names = ("id", "outcome", "reason", "success", "indicator", "metrics", "flags", "refusals")
        found.append({**{name: detail[name] for name in names}, "artifacts": detail["artifacts"]})
    return found
