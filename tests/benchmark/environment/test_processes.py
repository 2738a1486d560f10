"""Processes apart: what ends one costs one piece of work, and none outlives its parent."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator

import psutil
import pytest
from support.servers.stacks import wait_until
from support.warm_work import make

from buildarena_benchmark.environment.trials.warm_process import ProcessEndedError, WarmProcess

SPARE = 200 << 20


@pytest.fixture
def process() -> Iterator[WarmProcess]:
    made = WarmProcess("work", make, spare_bytes=SPARE)
    yield made
    made.close()


def test_it_stays_warm_between_questions_and_threads_until_it_is_closed(process) -> None:
    """A service's threads come and go."""
    pids: list[int] = []
    for _ in range(2):
        thread = threading.Thread(target=lambda: pids.append(process.ask(["pid"])))
        thread.start()
        thread.join()
        time.sleep(0.2)
    assert process.ask(["hello"]) == "hello"
    assert pids == [process.ask(["pid"])] * 2
    assert pids[0] != os.getpid()
    process.close()
    assert not psutil.pid_exists(pids[0])


def test_it_has_no_variable_that_it_does_not_need(process, monkeypatch) -> None:
    for name in (
        *("OPENAI_API_KEY", "BUILDARENA_DATABASE_URL", "AWS_SECRET_ACCESS_KEY"),
        *("LDAP_PASSWORD", "COVERALLS_REPO_TOKEN"),
    ):
        monkeypatch.setenv(name, "secret")
    monkeypatch.setenv("BUILDARENA_CATEGORIES", "/somewhere")
    found = process.ask(["variables"])
    wanted = {"PATH": os.environ["PATH"], "BUILDARENA_CATEGORIES": "/somewhere"}
    assert wanted.items() <= found.items()
    assert "secret" not in found.values()


@pytest.mark.ci
def test_one_that_dies_is_started_again(process) -> None:
    first = process.ask(["pid"])
    with pytest.raises(ProcessEndedError, match="of work ended with code -9") as raised:
        process.ask(["die"])
    assert raised.value.code == -signal.SIGKILL
    assert process.ask(["pid"]) != first
    psutil.Process(process.ask(["pid"])).kill()  # between two questions
    time.sleep(0.2)
    assert process.ask(["hello"]) == "hello"


@pytest.mark.ci
def test_memory_is_bounded(process) -> None:
    assert process.ask(["take", SPARE // 4]) == SPARE // 4
    with pytest.raises(ProcessEndedError):
        process.ask(["take", 2 * SPARE])
    assert process.ask(["hello"]) == "hello"


@pytest.mark.ci
def test_work_that_is_given_up_is_broken_off(process) -> None:
    pid = process.ask(["pid"])

    def enough() -> None:
        raise TimeoutError("enough")

    started = time.monotonic()
    with pytest.raises(TimeoutError, match="enough"):
        process.ask(["sleep", 60], meanwhile=enough)
    assert time.monotonic() - started < 5
    assert not psutil.pid_exists(pid)
    assert process.ask(["hello"]) == "hello"


PARENT = """
import subprocess, sys, os, signal
from buildarena_benchmark.environment.trials.processes import PARENT, dying_with_me
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
from buildarena_benchmark.environment.trials.processes import end_with_parent
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


def gone(pid: int) -> bool:
    try:
        return bool(psutil.Process(pid).status() == psutil.STATUS_ZOMBIE)
    except psutil.NoSuchProcess:
        return True
