"""A runner as it is started: a program that knows an address and a key."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path

import psutil
import pytest
from support.clients.commands import run, run_cli
from support.clients.tenants import ADMIN
from support.servers.runner_rig import SHORT, ended, runner_key, true_trajectory, waiting
from support.servers.stacks import wait_until

from buildarena_simulation import write_trajectory
from buildarena_simworker.remote.api import check_url, tls_context
from buildarena_simworker.remote.doctor import examined

pytestmark = pytest.mark.ci

BUILDARENA = str(Path(sys.executable).parent / "buildarena")
LONG = SHORT.replace("name: short", "name: long").replace("duration_s: 0.4", "duration_s: 600")
LONG += "constraints: {max_blocks: 30}\n"
UNNEEDED = {"celery", "kombu", "sqlalchemy", "redis", "psycopg", "obstore", "alembic", "fastapi"}


@pytest.fixture
def lease_s() -> float:
    """Leases run out while a test waits for that."""
    return 8.0


@contextmanager
def runner(folder: Path, url: str, secret: str, *more: str) -> Iterator[subprocess.Popen[bytes]]:
    """A runner's process; it is gone afterwards, with its children."""
    key = folder / "key"
    key.write_text(secret + "\n")
    ours = {name: value for name, value in os.environ.items() if "BUILDARENA" not in name}
    ours["BUILDARENA_STOP_GRACE_S"] = "3"
    words = ["admin", "worker", "simulate.mujoco", "--api", url, "--key-file", str(key), *more]
    with (folder / "runner.log").open("ab") as log:
        process = subprocess.Popen([BUILDARENA, *words], env=ours, stdout=log, stderr=log, cwd="/")
    family = psutil.Process(process.pid)
    try:
        yield process
        children = family.children(recursive=True) if process.poll() is None else []
    finally:
        process.kill()
        process.wait()
    _, alive = psutil.wait_procs(children, timeout=6)
    assert not alive


def engines(process: subprocess.Popen[bytes]) -> list[psutil.Process]:
    children = psutil.Process(process.pid).children(recursive=True)
    return [one for one in children if "spawn_main" in " ".join(one.cmdline())]


def test_a_runner_does_what_waits_and_hands_back_what_it_can_not_end(
    context, url, tmp_path
) -> None:
    jobs = [waiting(context, seed=seed) for seed in range(4)]
    digest = sha256(write_trajectory(true_trajectory(context, jobs[0]))).hexdigest()
    secret = runner_key(context)[1]
    with runner(tmp_path, url, secret, "--at-once", "2") as process:
        state = context.store.jobs.get
        wait_until(
            lambda: process.poll() is not None or all(state(j.id).state == "done" for j in jobs),
            150,
            "jobs are done",
        )
        assert process.poll() is None
        for job in jobs:
            kept = context.store.jobs.artifacts(ended(context, job).id)
            assert kept["trajectory-0"] == digest
        (worker,) = [
            w for w in context.store.workers.page(limit=100) if w.id.startswith("runner@key_")
        ]
        assert (worker.alive, worker.pid) == (True, process.pid)
        assert worker.peak_memory_bytes > 20_000_000
        long = waiting(context, LONG)
        wait_until(lambda: state(long.id).state == "running", 90, "the long trial runs")
        # A crashed engine costs one trial.
        for engine in engines(process):
            engine.kill()
        wait_until(lambda: state(long.id).faults == 1, 30, "the fault is reported")
        assert "ended with code -9 in the middle of a trial" in state(long.id).detail
        wait_until(lambda: state(long.id).state == "running", 90, "it is tried again")
        process.send_signal(signal.SIGTERM)
        assert process.wait(20) == 0
        now = state(long.id)
        assert (now.state, now.faults) == ("queued", 1)
        results = [one.result for one in context.store.jobs.attempts(long.id)]
        # The other slot may have been given it once more.
        assert results[0] == "fault"
        assert set(results[1:]) == {"handed_back"}
        assert not [w for w in context.store.workers.page(limit=100) if w.id == worker.id]


def test_a_killed_runner_costs_a_lease_and_leaves_no_process(context, url, tmp_path) -> None:
    job = waiting(context, LONG)
    secret = runner_key(context)[1]
    with runner(tmp_path, url, secret, "--at-once", "1") as process:
        wait_until(lambda: context.store.jobs.get(job.id).state == "running", 60, "it runs")
        children = wait_until(lambda: engines(process), 10, "the engine runs")
        process.kill()
        wait_until(lambda: context.store.jobs.get(job.id).faults == 1, 20, "it is recovered")
        _, alive = psutil.wait_procs(children, timeout=6)
        assert not alive
    assert context.store.jobs.attempts(job.id)[-1].result == "lost"


def test_a_runner_loads_nothing_that_it_does_not_need() -> None:
    script = (
        "import sys, json\n"
        "import buildarena_simworker.remote.process, buildarena_simworker.registered\n"
        "import buildarena_simworker.remote.doctor\n"
        "import buildarena_simworker_besiege.simulator\n"
        "print(json.dumps(sorted({name.split('.')[0] for name in sys.modules})))\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, check=True)
    loaded = set(json.loads(done.stdout))
    assert "httpx2" in loaded
    assert not loaded & (UNNEEDED | {"buildarena_store"})


def test_wrong_options_are_named(subtests) -> None:
    for words, says in [
        (["construct", "--api", "http://127.0.0.1:1"], "needs the database"),
        (["simulate.unity", "--api", "http://127.0.0.1:1"], "choose from"),
        (["simulate.mujoco", "--at-once", "2"], "--at-once: only with --api"),
        (["simulate.mujoco", "--key-file", __file__], "--key-file: only with --api"),
    ]:
        with subtests.test(words=words):
            done = run("admin", "worker", *words)
            assert done.returncode == 1
            assert says in done.stderr


def test_the_key_goes_to_no_odd_place(subtests) -> None:
    for url in ["ftp://a", "nothing", "http://", "https://u:p@a", "http://10.0.0.1", "http://lab"]:
        with (
            subtests.test(url=url),
            pytest.raises(ValueError, match=r"URL of an API|not encrypted"),
        ):
            check_url(url, allow_http=False)


def test_https_and_this_machine_need_no_leave() -> None:
    assert check_url("https://lab/", allow_http=False) == "https://lab"
    assert check_url("http://127.0.0.1:8321", allow_http=False) == "http://127.0.0.1:8321"
    assert check_url("http://lab:8321", allow_http=True) == "http://lab:8321"


def test_certificates_that_are_none_are_refused(tmp_path) -> None:
    file = tmp_path / "ca.pem"
    for make in (lambda: None, lambda: file.write_text("nothing")):
        make()
        with pytest.raises(ValueError, match=r"ca\.pem holds no certificates"):
            tls_context(file)


def test_the_doctor_says_what_a_runner_lacks(context, url, tmp_path, monkeypatch) -> None:
    monkeypatch.delenv("BUILDARENA_KEY", raising=False)

    def checked(secret: str | None, at: str = url) -> dict[str, bool]:
        key = None
        if secret is not None:
            key = tmp_path / "key"
            key.write_text(secret)
        return {check["name"]: check["ok"] for check in examined(at, "mujoco", key_file=key)}

    good = checked(runner_key(context)[1])
    assert good == {"simulator": True, "api": True, "key": True, "version": True}
    assert not checked(runner_key(context, "pybullet")[1])["key"]
    assert not checked(None)["key"]
    assert not checked(ADMIN)["key"]
    assert not checked("two words")["settings"]
    monkeypatch.setattr("buildarena_simworker.remote.doctor.RETRY_FOR_S", 0.2)
    assert not checked(None, "http://127.0.0.1:9")["api"]


def test_a_runner_key_is_made_by_the_command_line(url, monkeypatch) -> None:
    monkeypatch.setenv("BUILDARENA_KEY", ADMIN)
    words = (
        "admin",
        "key",
        "create",
        "lab",
        "--scope",
        "runner",
        "--simulator",
        "mujoco",
        "--json",
    )
    made = json.loads(run_cli(url, *words).stdout)
    assert (made["scopes"], made["simulators"], made["job_owners"]) == (
        ["runner"],
        ["mujoco"],
        None,
    )
    assert (
        "names its simulators"
        in run_cli(url, "admin", "key", "create", "a", "--scope", "runner").stderr
    )
