"""Programs that end with their parent."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import psutil
import pytest
from support.servers.stacks import wait_until

PARENT = """
import subprocess, sys, os, signal
from buildarena_environment.processes import PARENT, dying_with_me
child = subprocess.Popen(
    [sys.executable, "-c", sys.argv[1]],
    env={**os.environ, PARENT: str(os.getpid())},
    preexec_fn=dying_with_me() if sys.argv[2] == "signalled" else None,
    stdout=subprocess.PIPE,
)
print(child.pid, child.stdout.readline().decode().strip(), flush=True)
signal.pause()
"""
WATCHING = """
import signal, time
from buildarena_environment.processes import end_with_parent
end_with_parent()
{extra}
print("ready", flush=True)
time.sleep(60)
"""
STALLED = "signal.signal(signal.SIGTERM, lambda *_: None)"


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize(
    ("how", "child", "within_s"),
    [
        ("signalled", "import time; print('ready', flush=True); time.sleep(60)", 2),
        ("watching", WATCHING.format(extra=""), 4),
        (
            "watching",
            WATCHING.format(extra=STALLED).replace(
                "time.sleep(60)", "[time.sleep(1) for _ in range(60)]"
            ),
            9,
        ),
    ],
)
def test_a_program_ends_with_its_parent(how, child, within_s) -> None:
    if how == "signalled" and sys.platform != "linux":
        pytest.skip("only Linux signals children of a process that ended")
    with subprocess.Popen(
        [sys.executable, "-c", PARENT, child, how], stdout=subprocess.PIPE, text=True
    ) as parent:
        assert parent.stdout is not None
        pid, said = parent.stdout.readline().split()
        assert said == "ready"
        parent.send_signal(signal.SIGKILL)
        parent.wait()
        try:
            wait_until(lambda: gone(int(pid)), within_s, "the child ends")
        finally:
            if not gone(int(pid)):
                os.kill(int(pid), signal.SIGKILL)


@pytest.mark.ci
def test_a_program_that_nobody_told_of_a_parent_goes_on() -> None:
    code = WATCHING.format(extra="")
    launcher = (
        "import subprocess, sys; "
        f"p = subprocess.Popen([sys.executable, '-c', {code!r}], "
        "stdout=subprocess.PIPE, stderr=subprocess.DEVNULL); "
        "p.stdout.readline(); print(p.pid, flush=True)"
    )
    done = subprocess.run(
        [sys.executable, "-c", launcher], capture_output=True, text=True, check=True
    )
    pid = int(done.stdout)
    try:
        time.sleep(0.8)
        assert not gone(pid)
    finally:
        os.kill(pid, signal.SIGKILL)


def gone(pid: int) -> bool:
    try:
        return bool(psutil.Process(pid).status() == psutil.STATUS_ZOMBIE)
    except psutil.NoSuchProcess:
        return True
