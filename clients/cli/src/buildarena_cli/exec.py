"""Another program of ours in this one's place."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence


def exec_module(words: Sequence[str]) -> None:
    """Run ``python -m`` words so that signals reach it, and end with its exit code.

    On Windows no program can take another's place: it runs below this one, which waits for it.
    """
    command = [sys.executable, "-m", *words]
    if sys.platform == "win32":
        sys.exit(subprocess.call(command))
    os.execv(sys.executable, command)  # noqa: S606 - no shell
