"""A service in the background: started, looked at, killed, started again and stopped."""

import fcntl
import json
import os
import signal
from pathlib import Path

import psutil
import pytest
from support.clients.terminals import piped
from support.servers.stacks import wait_until

from buildarena_cli.local.server import free_port
from buildarena_cli.local.service import is_running, noted_run, running


@pytest.fixture
def data(tmp_path: Path) -> Path:
    for folder in (tmp_path, *tmp_path.parents[:3]):
        folder.chmod(folder.stat().st_mode | 0o055)  # Postgres runs as nobody under root
    return tmp_path / "data"


def gone(pids: list[int]) -> bool:
    there = [psutil.Process(pid).status() for pid in pids if psutil.pid_exists(pid)]
    return set(there) <= {psutil.STATUS_ZOMBIE}


@pytest.mark.ci
@pytest.mark.timeout(240)
def test_the_life_of_a_service_in_the_background(data) -> None:
    where, port = ("--data", str(data)), str(free_port())
    before = piped("admin", "status", *where)
    assert (before.returncode, before.stdout) == (1, f"nothing runs on {data}\n")
    up = piped("up", "--detach", "--port", port, *where)
    try:
        assert up.returncode == 0, up.stderr
        run = running(data)
        assert run is not None
        assert f"API http://127.0.0.1:{port}" in up.stdout
        assert os.getsid(run.pid) == run.pid != os.getsid(0)
        shown = json.loads(piped("admin", "status", "--json", *where).stdout)
        assert shown["healthy"] is True
        names = {process["name"] for process in shown["processes"]}
        assert {"supervisor", "postgres", "valkey", "api", "construct-worker"} <= names
        (api,) = (p for p in shown["processes"] if p["name"] == "api")
        assert api["ports"] == [int(port)]
        again = piped("up", "--detach", *where)
        assert (again.returncode, "another BuildArena runs" in again.stderr) == (1, True)
        wrong = piped("admin", "logs", "apu", *where)
        assert (wrong.returncode, "did you mean api?" in wrong.stderr) == (1, True)

        pids = [process["pid"] for process in shown["processes"]]
        pids += [child.pid for child in psutil.Process(run.pid).children(recursive=True)]
        os.kill(run.pid, signal.SIGKILL)
        wait_until(lambda: gone(pids), 15, "children end with their parent")
        after = piped("admin", "status", *where)
        assert (after.returncode, f"process {run.pid}" in after.stdout) == (1, True)

        assert piped("up", "--detach", "--port", port, *where).returncode == 0
        assert piped("admin", "status", *where).returncode == 0
    finally:
        last, down = noted_run(data), piped("down", *where)
    assert (down.returncode, down.stdout) == (0, "stopped\n")
    assert last is not None
    assert gone([last.pid, *last.processes.values()])
    assert not is_running(data)


def test_a_note_without_a_lock_is_of_a_run_that_is_over(tmp_path) -> None:
    note = {"url": "http://127.0.0.1:1", "pid": os.getpid(), "ready": True}
    note |= {"processes": {}, "stop_grace_s": 60.0}
    (tmp_path / "run.json").write_text(json.dumps(note))
    assert running(tmp_path) is None
    with (tmp_path / "lock").open("w") as lock:
        assert not is_running(tmp_path)
        fcntl.flock(lock, fcntl.LOCK_EX)
        assert running(tmp_path) == noted_run(tmp_path) is not None
        status = piped("admin", "status", "--data", str(tmp_path))
        assert (status.returncode, "does not answer" in status.stdout) == (1, True)
    (tmp_path / "run.json").write_text("{")
    assert noted_run(tmp_path) is None


def test_the_end_of_each_log_is_printed(tmp_path) -> None:
    (tmp_path / "logs").mkdir()
    for name in ("api", "mujoco-worker"):
        (tmp_path / "logs" / f"{name}.log").write_text("".join(f"{name} {n}\n" for n in range(9)))
    done = piped("admin", "logs", "-n", "1", "--data", str(tmp_path))
    assert done.stdout.splitlines() == ["api            api 8", "mujoco-worker  mujoco-worker 8"]
