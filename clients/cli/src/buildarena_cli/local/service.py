"""The service of a data folder: lookup, start in the background, stop and inspection.

A service on a folder holds a lock on its file ``lock`` and describes itself in ``run.json``. The
lock is released however its process ends; a ``run.json`` without a lock is of a run that is over.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import psutil

from buildarena_benchmark.environment.trials.processes import memory_bytes
from buildarena_cli.errors import CommandError

LOCK: Final = "lock"
RUN: Final = "run.json"
SUPERVISOR: Final = "supervisor"
START_WITHIN_S: Final = 120.0
SERVERS_STOP_WITHIN_S: Final = 45.0
"""Database and broker stop after all programs, and write what they have."""
POLL_S: Final = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """Record of a run, which ``run.json`` has.

    Attributes:
        url: URL of the API.
        pid: Id of the process that started all others.
        ready: Whether all parts have answered.
        processes: Process ids by name.
        stop_grace_s: Time for its programs to stop, seconds.
    """

    url: str
    pid: int
    ready: bool
    processes: Mapping[str, int]
    stop_grace_s: float


def is_running(data: Path) -> bool:
    """Return whether a service runs on a data folder, regardless of its ``run.json``."""
    try:
        with (data / LOCK).open("rb") as lock:
            fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except (FileNotFoundError, NotADirectoryError):
        return False
    except BlockingIOError:
        return True
    except OSError as error:
        raise CommandError(f"{data / LOCK} can't be read: {error.strerror}") from error
    return False


def noted_run(data: Path) -> Run | None:
    """Return the last run on a data folder, whether it is over or not."""
    try:
        return Run(**json.loads((data / RUN).read_text()))
    except (OSError, ValueError, TypeError):
        return None


def running(data: Path) -> Run | None:
    """Return the active run on a data folder, if any."""
    return noted_run(data) if is_running(data) else None


def start(data: Path, arguments: Sequence[str]) -> Run:
    """Start a service that outlives this process, and wait until everything answers.

    Args:
        arguments: Options of `buildarena up`.

    Raises:
        CommandError: The service did not start.
    """
    log_file = data.absolute() / "logs" / f"{SUPERVISOR}.log"
    log_file.parent.mkdir(parents=True, exist_ok=True)
    with log_file.open("ab") as log:
        written = log.tell()
        process = subprocess.Popen(
            [sys.executable, "-m", "buildarena_cli", "up", "--data", str(data), *arguments],
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=subprocess.STDOUT,
            # In a new session, which the end of the terminal does not reach.
            start_new_session=True,
        )
    try:
        return _ready(data, process, log_file, written)
    except BaseException:
        process.terminate()
        process.wait()
        raise


def stop(data: Path) -> bool:
    """Stop the service of a data folder and wait until it is gone.

    Returns:
        Whether one ran.

    Raises:
        CommandError: It belongs to another user, or does not end.
    """
    started = time.monotonic()
    if not is_running(data):
        return False
    run = noted_run(data)
    if run is None:
        raise CommandError(f"{data / RUN} does not name the process that runs there")
    try:
        os.kill(run.pid, signal.SIGTERM)
    except ProcessLookupError:
        pass
    except PermissionError as error:
        raise CommandError(f"process {run.pid} belongs to another user") from error
    within_s = run.stop_grace_s + SERVERS_STOP_WITHIN_S
    # The lock goes a moment before its process does.
    while is_running(data) or _lives(run.pid):
        if time.monotonic() > started + within_s:
            raise CommandError(
                f"process {run.pid} has not ended within {within_s:.0f} s: "
                f"see {data.absolute() / 'logs'}"
            )
        time.sleep(POLL_S)
    return True


def process_facts(run: Run) -> list[dict[str, Any]]:
    """Return facts about a run's processes, the supervisor first.

    Returns:
        ``name``, which is that of its log, ``pid``, ``started_at`` in seconds since 1970,
        ``memory_bytes`` with its children, and the TCP ``ports`` it listens on; None and nothing
        of one that is gone or belongs to another user.
    """
    return [_facts(SUPERVISOR, run.pid), *(_facts(n, pid) for n, pid in run.processes.items())]


def log_name(process: str) -> str:
    """Return a process' name in the form of its log file and of the command `logs`."""
    return process.replace(" ", "-")


def unwritable(data: Path, error: OSError) -> CommandError:
    """Return the message for a data folder that is not writable."""
    return CommandError(
        f"the data folder {data} can't be written ({error.strerror}): "
        "choose another with --data or BUILDARENA_DATA"
    )


def log_files(data: Path) -> dict[str, Path]:
    """Return the logs by the name of their process."""
    return {file.stem: file for file in sorted((data.absolute() / "logs").glob("*.log"))}


def _ready(data: Path, process: subprocess.Popen[bytes], log_file: Path, written: int) -> Run:
    deadline = time.monotonic() + START_WITHIN_S
    while time.monotonic() < deadline:
        if process.poll() is not None:
            written_since = (
                log_file.read_bytes()[written:].decode(errors="replace").strip().splitlines()
            )
            raise CommandError(
                written_since[-1] if written_since else f"it ended at once (see {log_file})"
            )
        run = noted_run(data)
        if run is not None and run.pid == process.pid and run.ready:
            return run
        time.sleep(POLL_S)
    raise CommandError(f"not ready within {START_WITHIN_S:.0f} s (see {log_file})")


def _lives(pid: int) -> bool:
    """Return whether a process still runs and is not a zombie."""
    try:
        return bool(psutil.Process(pid).status() != psutil.STATUS_ZOMBIE)
    except psutil.NoSuchProcess:
        return False


def _facts(name: str, pid: int) -> dict[str, Any]:
    memory, started, ports = None, None, set()
    with contextlib.suppress(psutil.Error):
        process = psutil.Process(pid)
        started = process.create_time()
        # The supervisor's children have their own rows.
        members = [process] if name == SUPERVISOR else [process, *process.children(recursive=True)]
        memory = sum(memory_bytes(member) for member in members)
        for member in members:
            with contextlib.suppress(psutil.Error):
                listening = member.net_connections("tcp")
                ports |= {c.laddr.port for c in listening if c.status == psutil.CONN_LISTEN}
    return {
        "name": log_name(name),
        "pid": pid,
        "started_at": started,
        "memory_bytes": memory,
        "ports": sorted(ports),
    }
