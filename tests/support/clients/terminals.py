"""Commands on a terminal of a given width, and through a pipe."""

import fcntl
import os
import pty
import struct
import subprocess
import sys
import termios
from pathlib import Path

from support.programs import captured

BUILDARENA = str(Path(sys.executable).parent / "buildarena")


def piped(*words: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Runs a command whose output is a pipe."""
    return captured([BUILDARENA, *words], within_s=120, env=_environment(environment))


def on_terminal(width: int, *words: str, **environment: str) -> tuple[int, str]:
    """Runs a command on a terminal of so many columns; its exit code and all that it shows."""
    master, slave = pty.openpty()
    fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 50, width, 0, 0))
    told = {"env": _environment({"TERM": "xterm-256color", **environment})}
    told |= dict.fromkeys(("stdin", "stdout", "stderr"), slave)
    process = subprocess.Popen([BUILDARENA, *words], **told)
    os.close(slave)
    shown = b""
    try:
        while chunk := os.read(master, 65536):
            shown += chunk
    except OSError:
        pass  # Linux says so when the other end is closed
    os.close(master)
    return process.wait(), shown.decode().replace("\r\n", "\n")


def _environment(given: dict[str, str]) -> dict[str, str]:
    kept = {k: v for k, v in os.environ.items() if k not in {"COLUMNS", "LINES", "NO_COLOR"}}
    return {**kept, **given}
