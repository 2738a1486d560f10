"""Replacement of this process by another program."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence


def exec_module(arguments: Sequence[str]) -> None:
    """Replace this process by ``python -m`` with arguments, so that signals reach it.

    On Windows it runs as a child process, which this one waits for.
    """
    command = [sys.executable, "-m", *arguments]
    if sys.platform == "win32":
        sys.exit(subprocess.call(command))
    os.execv(sys.executable, command)  # noqa: S606 - no shell
