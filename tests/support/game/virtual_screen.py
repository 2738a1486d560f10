"""A screen without a monitor: Xvfb on a display of its own."""

import os
import select
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

PROGRAMS: Final = {"Xvfb": "xvfb", "xclip": "xclip"}
"""What must be installed, and the Debian package it comes in."""

_START_S: Final = 20.0


class NoScreenError(RuntimeError):
    """There is no virtual screen; the message says what to install."""


def missing_packages() -> str:
    """A sentence that says what to install; "" if nothing is missing."""
    lacking = [package for name, package in PROGRAMS.items() if shutil.which(name) is None]
    if not lacking:
        return ""
    return f"this needs a virtual screen: install the Debian packages {' and '.join(lacking)}"


@contextmanager
def virtual_screen(size: tuple[int, int] = (1400, 900)) -> Iterator[dict[str, str]]:
    """A screen of a size in pixels; gives the environment of the programs that are shown there."""
    lacking = missing_packages()
    if lacking:
        raise NoScreenError(lacking)
    policy, writing = os.pipe()
    words = ["Xvfb", "-displayfd", str(writing), "-screen", "0", f"{size[0]}x{size[1]}x24"]
    silent = dict.fromkeys(("stdout", "stderr"), subprocess.DEVNULL)
    server = subprocess.Popen(
        [*words, "-nolisten", "tcp", "-noreset"], pass_fds=[writing], **silent
    )
    os.close(writing)
    try:
        # python-xlib insists on a file of keys, which a server of one's own has no need of.
        yield {"DISPLAY": f":{_display_number(policy)}", "XAUTHORITY": os.devnull}
    finally:
        os.close(policy)
        server.terminate()
        try:
            server.wait(timeout=5)
        except subprocess.TimeoutExpired:
            server.kill()
            server.wait()


def _display_number(policy: int) -> int:
    """The number Xvfb tells once it listens: it chooses a free one itself."""
    told = b""
    while not told.endswith(b"\n"):
        ready, _, _ = select.select([policy], [], [], _START_S)
        part = os.read(policy, 16) if ready else b""
        if not part:
            raise NoScreenError("Xvfb did not start")
        told += part
    return int(told)
