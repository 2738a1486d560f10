"""The framework's real server on loopback, in a process of its own, and the expert's calls."""

from __future__ import annotations

from buildarena_geometry import kernels  # noqa: F401 -- before numpy

# isort: split

import json
import os
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

DATA = Path(__file__).parents[3] / "build/expert_calls.json"


@pytest.fixture(scope="session")
def experts() -> dict[str, Any]:
    return json.loads(DATA.read_text())


def free_port() -> int:
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return found.getsockname()[1]


@pytest.fixture
def port() -> int:
    return free_port()


@contextmanager
def served(*arguments: str) -> Iterator[tuple[str, subprocess.Popen]]:
    port = free_port()
    process = subprocess.Popen(
        [str(Path(sys.executable).parent / "buildarena-openenv"), "--port", str(port), *arguments],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "ENABLE_WEB_INTERFACE": "false"},
    )
    url = f"http://127.0.0.1:{port}"
    try:
        deadline = time.monotonic() + 90
        while True:
            try:
                urllib.request.urlopen(f"{url}/health", timeout=2).close()
                break
            except OSError:
                assert process.poll() is None, "the server ended"
                assert time.monotonic() < deadline, "the server does not answer"
                time.sleep(0.1)
        yield url, process
    finally:
        process.terminate()
        process.wait(20)


@pytest.fixture(scope="session")
def server() -> Iterator[tuple[str, subprocess.Popen]]:
    more = ("--max-steps", "300", "--simulator", "mujoco")
    with served("--max-sessions", "12", "--processes", "1", *more) as found:
        yield found


@pytest.fixture
def serving():
    """Makes a server of its own for a test."""
    return served
