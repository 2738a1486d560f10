"""Child processes that never outlive their parent, and the memory of a process tree."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from pathlib import Path

import psutil

PR_SET_PDEATHSIG = 1
# Looked up at import: between fork and exec only the call itself is safe.
_prctl = ctypes.CDLL(None).prctl if sys.platform == "linux" else None


def die_with_parent(signal_number: int = signal.SIGTERM) -> None:
    """On Linux, has this process signalled when the thread that started it ends."""
    if _prctl is not None:
        _prctl(PR_SET_PDEATHSIG, int(signal_number))


def tree_memory_bytes(pid: int | None = None) -> int:
    """Memory of a process and all its children, shared pages counted once.

    Args:
        pid: The process; this one by default.
    """
    try:
        root = psutil.Process(pid or os.getpid())
        members = [root, *root.children(recursive=True)]
    except psutil.NoSuchProcess:
        return 0
    return sum(memory_bytes(member) for member in members)


def memory_bytes(process: psutil.Process) -> int:
    """A process' share of memory: pages that several use are divided among them; 0 when gone."""
    try:
        for line in Path(f"/proc/{process.pid}/smaps_rollup").read_text().splitlines():
            if line.startswith("Pss:"):
                return int(line.split()[1]) * 1024
    except OSError:
        pass
    try:
        return int(process.memory_info().rss)
    except psutil.Error:
        return 0
