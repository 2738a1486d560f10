"""Child processes that never outlive their parent, and the memory of a process."""

import ctypes
import os
import re
import signal
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

import psutil

ALLOCATOR = {"MALLOC_ARENA_MAX": "2", "MALLOC_TRIM_THRESHOLD_": "131072"}
"""Environment of processes that run for long: each arena of glibc keeps what its largest use took,
and threads of a service would have sixteen on two processors."""
PR_SET_PDEATHSIG = 1
PARENT = "BUILDARENA_PARENT_PID"
"""Environment variable of a program that is to end with this process."""
LOOK_EVERY_S = 0.5
GRACE_S = 4.0
"""Time for a program to end in good order when its parent is gone."""
NEEDED: Final = re.compile(
    r"PATH|HOME|USERPROFILE|TZ|TEMP|TMP|TMPDIR|LANG|SYSTEMROOT|PATHEXT|BUILDARENA_CATEGORIES|"
    r"(LC|LD|OMP|OPENBLAS|MALLOC|COVERAGE|COV_CORE)_\w+|PYTHON[A-Z0-9]*",
    re.IGNORECASE,
)
"""Environment variables that a process needs which does no more than calculate."""
# Looked up at import: between fork and exec only the call itself is safe.
_prctl = ctypes.CDLL(None).prctl if sys.platform == "linux" else None


def forget_other_variables() -> None:
    """Remove every environment variable of this process that is not `NEEDED`, secrets above all."""
    for name in [name for name in os.environ if not NEEDED.fullmatch(name)]:
        del os.environ[name]


def die_with_parent(signal_number: int = signal.SIGTERM) -> None:
    """Have this process signalled, on Linux, when the thread that started it ends."""
    if _prctl is not None:
        _prctl(PR_SET_PDEATHSIG, int(signal_number))


def dying_with_me(signal_number: int = signal.SIGTERM) -> Callable[[], None]:
    """Return a function that a child calls before it becomes another program, to die with this one.

    Unlike `die_with_parent` alone it also ends a child whose parent died before the call.
    """
    parent = os.getpid()

    def prepare() -> None:
        die_with_parent(signal_number)
        if os.getppid() != parent:
            os._exit(1)

    return prepare


def end_with_parent(parent: int | None = None) -> None:
    """Have this program end soon after its parent, on all systems and whatever it is busy with.

    A supervisor of many threads starts ours so, and servers of others by `dying_with_me`: what runs
    between fork and exec can crash in a process of many threads.

    Args:
        parent: Process id of the parent; by default that of the environment variable, if any.
    """
    named = os.environ.get(PARENT, "") if parent is None else str(parent)
    if named.isdecimal():
        die_with_parent()
        threading.Thread(target=_watch, args=(int(named),), name="parent", daemon=True).start()


def _watch(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(LOOK_EVERY_S)
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(GRACE_S)
    os._exit(1)


def memory_bytes(process: psutil.Process) -> int:
    """Return a process' share of memory: shared pages are divided among users; 0 when gone."""
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
