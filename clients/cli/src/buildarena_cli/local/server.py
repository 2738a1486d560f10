"""What embedded servers have in common."""

from __future__ import annotations

import contextlib
import secrets
import socket
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from buildarena_pipeline.errors import StartupError

LOOPBACK = "127.0.0.1"
READY_WITHIN_S = 30.0


class EmbeddedServer(Protocol):
    """A server that runs as a child of this process."""

    name: str
    url: str

    def start(self) -> subprocess.Popen[bytes]:
        """Starts it and waits until it answers."""

    def stop(self, process: subprocess.Popen[bytes]) -> None:
        """Asks it to end and waits."""


def free_port() -> int:
    """A loopback port that nothing listens on at this moment."""
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return int(probe.getsockname()[1])


def secret_in(path: Path) -> str:
    """The secret kept in a file that only its owner can read; made at the first call."""
    with contextlib.suppress(FileNotFoundError):
        return path.read_text()
    secret = secrets.token_urlsafe(24)
    path.touch(mode=0o600)
    path.write_text(secret)
    return secret


def wait_until_ready(
    name: str, process: subprocess.Popen[bytes], ready: Callable[[], bool], log_file: Path
) -> None:
    """Waits until a server says that it is ready.

    Args:
        name: For messages.
        process: The server.
        ready: Asks whether this very process serves; another one on its port does not count.
        log_file: Where the server writes what it does.

    Raises:
        StartupError: The process ended, or was not ready in time; it is gone then.
    """
    deadline = time.monotonic() + READY_WITHIN_S
    while time.monotonic() < deadline:
        if process.poll() is not None:
            raise StartupError(f"{name} ended at once: {last_line(log_file)} (see {log_file})")
        if ready():
            return
        time.sleep(0.02)
    process.kill()
    process.wait()
    raise StartupError(f"{name} was not ready within {READY_WITHIN_S:.0f} s (see {log_file})")


def last_line(log_file: Path) -> str:
    """The last line of a log file that says something."""
    with contextlib.suppress(OSError):
        lines = [line for line in log_file.read_text(errors="replace").splitlines() if line.strip()]
        if lines:
            return lines[-1].strip()
    return "it wrote no log"


def stop_process(process: subprocess.Popen[bytes], signal_number: int, within_s: float) -> None:
    """Signals a process, waits, and kills it when it does not end in time."""
    if process.poll() is None:
        process.send_signal(signal_number)
    try:
        process.wait(timeout=within_s)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
