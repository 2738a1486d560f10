import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator

import psutil
import pytest
from redis import Redis
from support.servers.stacks import wait_until

from buildarena_cli.local import EmbeddedValkey, ManagedProcess, Supervisor
from buildarena_cli.local.supervisor import LOOK_EVERY_S
from buildarena_pipeline.errors import StartupError


@pytest.mark.ci
def test_a_killed_broker_is_started_again_with_its_data(tmp_path) -> None:
    valkey = EmbeddedValkey(tmp_path / "valkey", tmp_path / "log")
    managed = ManagedProcess(name="valkey", start=valkey.start, stop=valkey.stop)
    with Supervisor() as supervisor, Redis.from_url(valkey.url, retry=None) as client:
        supervisor.launch(managed)
        supervisor.watch()
        client.set("k", "v")
        time.sleep(1.2)  # appendfsync everysec
        first = managed.process
        first.kill()
        wait_until(lambda: managed.process is not first, 10, "it is started again")
        assert client.get("k") == b"v"
        pid = managed.process.pid
    assert not psutil.pid_exists(pid)


@pytest.mark.ci
def test_a_process_that_keeps_dying_is_given_up() -> None:
    def start() -> subprocess.Popen[bytes]:
        return subprocess.Popen([sys.executable, "-c", "raise SystemExit(3)"])

    with Supervisor() as supervisor:
        supervisor.launch(ManagedProcess(name="mayfly", start=start))
        supervisor.watch()
        wait_until(lambda: supervisor.failed is not None, 10, "it is given up")
    assert "mayfly died 6 times" in supervisor.failed
    assert "exit code 3" in supervisor.failed


def sleeper() -> subprocess.Popen[bytes]:
    return subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])


@pytest.fixture
def started() -> Iterator[list[subprocess.Popen[bytes]]]:
    """What a test starts; whatever happens, nothing of it is left."""
    processes: list[subprocess.Popen[bytes]] = []
    yield processes
    for process in processes:
        process.kill()
        process.wait()


def test_what_is_started_again_while_all_is_stopped_is_stopped_too(started) -> None:
    restarting, stopping = threading.Event(), threading.Event()

    def start() -> subprocess.Popen[bytes]:
        if started:
            restarting.set()
            assert stopping.wait(timeout=10)
            time.sleep(0.3)  # long enough for a stop that does not wait to be over
        started.append(sleeper())
        return started[-1]

    with Supervisor() as supervisor:
        supervisor.launch(ManagedProcess(name="slow", start=start))
        supervisor.watch()
        started[0].kill()
        assert restarting.wait(timeout=10)
        stopping.set()
    assert len(started) == 2
    assert [process.returncode for process in started] == [-signal.SIGKILL, -signal.SIGTERM]


@pytest.mark.ci
def test_what_dies_while_all_is_stopped_is_not_started_again(started) -> None:
    def start() -> subprocess.Popen[bytes]:
        started.append(sleeper())
        return started[-1]

    def stop(process: subprocess.Popen[bytes]) -> None:
        process.kill()
        process.wait()
        time.sleep(3 * LOOK_EVERY_S)

    with Supervisor() as supervisor:
        for name in ("one", "two"):
            supervisor.launch(ManagedProcess(name=name, start=start, stop=stop))
        supervisor.watch()
    assert [process.returncode for process in started] == [-signal.SIGKILL] * 2


def test_a_server_that_ends_at_once_is_reported(tmp_path) -> None:
    valkey = EmbeddedValkey(tmp_path / "valkey", tmp_path / "log")
    process = valkey.start()
    try:
        with pytest.raises(StartupError, match="valkey ended at once"):
            valkey.start()  # its port is taken
    finally:
        valkey.stop(process)


@pytest.mark.ci
def test_children_do_not_outlive_a_killed_parent(tmp_path) -> None:
    program = (
        "import sys, time, pathlib\n"
        "from buildarena_cli.local import EmbeddedValkey\n"
        "folder = pathlib.Path(sys.argv[1])\n"
        "print(EmbeddedValkey(folder / 'v', folder / 'log').start().pid, flush=True)\n"
        "time.sleep(60)\n"
    )
    parent = subprocess.Popen(
        [sys.executable, "-c", program, str(tmp_path)], stdout=subprocess.PIPE
    )
    assert parent.stdout is not None
    child = int(parent.stdout.readline())
    os.kill(parent.pid, signal.SIGKILL)
    parent.wait()
    parent.stdout.close()
    wait_until(lambda: not psutil.pid_exists(child), 10, "the child ends")
