"""Who simulates, as a program and by either way to the service: what comes of it, and stops."""

import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path

import psutil
import pytest
from sqlalchemy import select
from support.clients.commands import run, run_cli
from support.clients.tenants import ADMIN
from support.clients.terminals import BUILDARENA
from support.jobs import expire_leases
from support.programs import variables_of
from support.servers.runner_rig import (
    MISSING,
    SHORT,
    VERSIONS,
    ended,
    pause_ends,
    runner_key,
    slot,
    true_trajectory,
    two_blocks,
    waiting,
)
from support.servers.stacks import wait_until

from buildarena_backend.database.tables import leases
from buildarena_backend.errors import PermanentError, StartupError
from buildarena_backend.process.active_lease import LeaseKeeper
from buildarena_backend.process.job_runner import JobRunner
from buildarena_backend.trials.simulator import SimulatorFaultError
from buildarena_backend.trials.trials import File, TrialRequest, TrialResult
from buildarena_benchmark import score
from buildarena_simulation import write_trajectory
from buildarena_simworker.engines import EngineSimulator
from buildarena_simworker.remote.api import check_url, tls_context
from buildarena_simworker.remote.doctor import check_runner
from buildarena_simworker.simulate import SimulateHandler

Around = Callable[[TrialRequest, Callable[[], TrialResult]], TrialResult]
QUEUE = "simulate.mujoco"
QUEUES = "construct, simulate.pybullet, simulate.mujoco, simulate.besiege"
FEW_BLOCKS = "constraints: {max_blocks: 30}\n"
SECONDS = SHORT.replace("duration_s: 0.4", "duration_s: 400").replace("short", "seconds")
ENDLESS = SHORT.replace("duration_s: 0.4", "duration_s: 600").replace("short", "endless")
UNNEEDED = {"celery", "kombu", "sqlalchemy", "redis", "psycopg", "obstore", "alembic"}
UNNEEDED |= {"fastapi", "PIL", "pyautogui", "pyperclip"}


@pytest.fixture
def lease_s() -> float:
    """Leases run out while a test waits for that."""
    return 8.0


@pytest.fixture(params=["database", "api"])
def do_next(request, context, url) -> Iterator[Callable[..., bool]]:
    """Does the next trial with a simulator, by one way or the other; says whether there was one."""
    secret = runner_key(context)[1]
    keeper = LeaseKeeper(context.store.leases, lambda: None)
    keeper.start()

    def do(simulator: EngineSimulator | None = None) -> bool:
        if request.param == "api":
            with slot(url, secret, simulator) as one:
                return one.do_next(0)
        handler = SimulateHandler(context, simulator or EngineSimulator("mujoco"))
        return JobRunner(context.store.leases, handler, keeper, "w").process_next(QUEUE)

    yield do
    keeper.stop()


class Played(EngineSimulator):
    """The engine, with something done around a trial."""

    def __init__(self, around: Around) -> None:
        super().__init__("mujoco")
        self._around = around

    def run(self, trial: TrialRequest) -> TrialResult:
        return self._around(trial, lambda: super(Played, self).run(trial))


def raising(error: Exception) -> Played:
    def around(*_: object) -> TrialResult:
        raise error

    return Played(around)


def test_a_trial_is_scored_and_kept_with_its_files(context, do_next) -> None:
    job = waiting(context)
    trajectory = true_trajectory(context, job)
    found = score(context.tasks.exact(job.task, job.task_version), two_blocks(), trajectory)
    log = {"log-0.txt": File(data=b"it went well", media_type="text/plain")}

    def around(_: TrialRequest, run: Callable[[], TrialResult]) -> TrialResult:
        done = run()
        return TrialResult(trajectory=done.trajectory, versions=done.versions, files=log)

    assert do_next(Played(around))
    assert not do_next()
    now = ended(context, job)
    digest = sha256(write_trajectory(trajectory)).hexdigest()
    scored = now.success, now.indicator, now.metrics
    assert scored == (found.success, found.indicator, dict(found.metrics))
    assert (now.manifest["simulator"], now.manifest["trajectory"]) == (VERSIONS, digest)
    kept = {file.name: (file.sha256, file.media_type) for file in context.store.jobs.files(job.id)}
    assert kept["trajectory-0"][0] == digest
    assert kept["log-0.txt"] == (sha256(b"it went well").hexdigest(), "text/plain")
    (record,) = context.store.rollouts.read(job.id)
    assert record.trajectory_hash == digest
    assert record.trace[0][0] == 0.0
    assert record.wall_s > 0
    assert [one.result for one in context.store.jobs.attempts(job.id)] == ["done"]


def test_a_machine_that_is_refused_has_failed(context, do_next) -> None:
    job = waiting(context, MISSING)
    assert do_next()
    now = ended(context, job)
    assert (now.outcome, now.indicator, now.metrics["parts"]) == ("unsuccessful", 0.0, 2)
    (record,) = context.store.rollouts.read(job.id)
    assert (record.trajectory_hash, record.trace) == (None, [])
    assert "which is tracked" in now.manifest["simulator"]["refused"]


def test_a_fault_keeps_its_evidence_and_is_tried_again(context, do_next) -> None:
    shot = {"screenshot-0-2-0.png": File(data=b"a picture", media_type="image/png")}
    for seed, error in enumerate(
        (
            SimulatorFaultError("a person must come", endless=True),
            RuntimeError("nobody foresaw this"),
            SimulatorFaultError("it hangs", files=shot, delay_s=0.0),
        )
    ):
        job = waiting(context, seed=seed)
        assert do_next(raising(error))
        now = context.store.jobs.get(job.id)
        assert (now.state, now.faults, now.success) == ("queued", 1, None)
        assert str(error) in now.detail
        if seed < 2:
            context.store.lifecycle.cancel_job(job.id, owner=None, force=True)
    kept = context.store.jobs.artifacts(job.id)["screenshot-0-2-0.png"]
    assert context.artifacts.get(kept) == b"a picture"
    pause_ends(context)
    assert do_next()
    assert ended(context, job).success is not None


def test_a_wrong_game_ends_a_job_unless_a_key_alone_says_so(context, do_next, request) -> None:
    job = waiting(context)
    assert do_next(raising(PermanentError("another game", reason="game_version")))
    now = context.store.jobs.get(job.id)
    by_api = "[api]" in request.node.name
    assert (now.state, now.reason) == (("queued", None) if by_api else ("done", "game_version"))
    assert not do_next()


@pytest.mark.ci
def test_a_cancelled_trial_is_broken_off(context, do_next) -> None:
    job = waiting(context)

    def around(trial: TrialRequest, run: Callable[[], TrialResult]) -> TrialResult:
        context.store.lifecycle.cancel_job(job.id, owner=None, force=True)
        for _ in range(200):
            trial.require_held()
            threading.Event().wait(0.05)
        return run()

    assert do_next(Played(around))
    now = ended(context, job)
    assert (now.outcome, now.success) == ("cancelled", None)
    assert context.store.jobs.attempts(job.id)[-1].result == "cancelled"


def test_who_lost_its_lease_writes_nothing(context, do_next) -> None:
    job = waiting(context)

    def around(_: TrialRequest, run: Callable[[], TrialResult]) -> TrialResult:
        done = run()
        expire_leases(context)
        context.store.leases.recover()
        assert context.store.leases.claim(QUEUE, owner="another") is not None
        return done

    assert do_next(Played(around))
    now = context.store.jobs.get(job.id)
    assert (now.state, now.success, now.lease_owner) == ("running", None, "another")
    assert [one.result for one in context.store.jobs.attempts(job.id)][-2:] == ["lost", None]


@contextmanager
def started(*words: str, cwd: Path, **environment: str) -> Iterator[subprocess.Popen[bytes]]:
    """A process; it is gone afterwards, with its children."""
    kept = {name: value for name, value in os.environ.items() if "BUILDARENA" not in name}
    with (cwd / "process.log").open("ab") as log:
        process = subprocess.Popen(words, env=kept | environment, stdout=log, stderr=log, cwd="/")
    family, children = psutil.Process(process.pid), []
    try:
        yield process
        children = family.children(recursive=True) if process.poll() is None else []
    finally:
        process.kill()
        process.wait()
    _, alive = psutil.wait_procs(children, timeout=6)
    assert not alive


def runner(folder: Path, url: str, secret: str, at_once: int):
    (folder / "key").write_text(secret + "\n")
    words = ["admin", "worker", QUEUE, "--api", url, "--key-file", str(folder / "key")]
    words += ["--concurrency", str(at_once)]
    return started(BUILDARENA, *words, cwd=folder, BUILDARENA_STOP_GRACE_S="3")


def engines(process: subprocess.Popen[bytes]) -> list[psutil.Process]:
    children = psutil.Process(process.pid).children(recursive=True)
    return [one for one in children if "spawn_main" in " ".join(one.cmdline())]


@pytest.mark.ci
def test_a_runner_does_what_waits_and_hands_back_what_it_cannot_end(context, url, tmp_path) -> None:
    state = context.store.jobs.get
    jobs = [waiting(context, seed=seed) for seed in range(3)]
    with runner(tmp_path, url, runner_key(context)[1], 2) as process:

        def ended_all() -> bool:
            return process.poll() is not None or all(state(j.id).state == "done" for j in jobs)

        wait_until(ended_all, 150, "jobs are done")
        assert process.poll() is None
        for job in jobs:
            digest = sha256(write_trajectory(true_trajectory(context, job))).hexdigest()
            assert context.store.jobs.artifacts(ended(context, job).id)["trajectory-0"] == digest
        workers = context.store.workers.page(limit=100)
        (worker,) = [each for each in workers if each.id.startswith("runner@key_")]
        assert (worker.alive, worker.pid) == (True, process.pid)
        long = waiting(context, ENDLESS + FEW_BLOCKS)
        wait_until(lambda: state(long.id).state == "running", 90, "the long trial runs")
        # A crashed engine costs one trial.
        for engine in engines(process):
            engine.kill()
        wait_until(lambda: state(long.id).faults == 1, 30, "the fault is reported")
        assert "ended with code -9 in the middle of a trial" in state(long.id).detail
        wait_until(lambda: state(long.id).state == "running", 90, "it is tried again")
        for _ in range(50):  # however often it is asked
            process.send_signal(signal.SIGTERM)
        assert process.wait(20) == 0
        assert (state(long.id).state, state(long.id).faults) == ("queued", 1)
        results = [one.result for one in context.store.jobs.attempts(long.id)]
        # The other slot may have been given it once more.
        assert (results[0], set(results[1:])) == ("fault", {"handed_back"})
        assert worker.id not in {each.id for each in context.store.workers.page(limit=100)}


@pytest.mark.nightly
def test_a_killed_runner_costs_a_lease_and_leaves_no_process(context, url, tmp_path) -> None:
    job = waiting(context, ENDLESS + FEW_BLOCKS)
    with runner(tmp_path, url, runner_key(context)[1], 1) as process:
        wait_until(lambda: context.store.jobs.get(job.id).state == "running", 60, "it runs")
        children = wait_until(lambda: engines(process), 10, "the engine runs")
        process.kill()
        wait_until(lambda: context.store.jobs.get(job.id).faults == 1, 20, "it is recovered")
        _, alive = psutil.wait_procs(children, timeout=6)
        assert not alive
    assert context.store.jobs.attempts(job.id)[-1].result == "lost"


@pytest.mark.ci
@pytest.mark.parametrize("case", [(SECONDS, 120, "done"), (ENDLESS, 3, "handed_back")])
def test_a_stopped_worker_finishes_its_trial_or_hands_it_back(
    context, settings, tmp_path, case
) -> None:
    task, grace_s, result = case

    def expires():
        query = select(leases.c.expires_at).where(leases.c.job_id == job.id)
        with context.store.database.statement() as connection:
            return connection.execute(query).scalar_one_or_none()

    job = waiting(context, task + FEW_BLOCKS)
    words = [sys.executable, "-m", "buildarena_simworker", "--simulator", "mujoco"]
    environment = variables_of(settings, lease_s=settings.lease_s, stop_grace_s=grace_s)
    with started(*words, cwd=tmp_path, **environment) as process:
        first = wait_until(expires, 60, "it is leased")
        wait_until(lambda: expires() != first, 20, "it is worked on")
        process.send_signal(signal.SIGTERM)
        assert process.wait(100) == 0
    assert context.store.jobs.attempts(job.id)[-1].result == result
    assert context.store.jobs.get(job.id).faults == 0


@pytest.mark.ci
def test_a_runner_loads_nothing_that_it_does_not_need() -> None:
    script = (
        "import sys, json\n"
        "import buildarena_simworker.remote.process, buildarena_simworker.engines\n"
        "import buildarena_simworker.remote.doctor\n"
        "import buildarena_simworker.besiege.simulator\n"
        "print(json.dumps(sorted({name.split('.')[0] for name in sys.modules})))\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, check=True)
    loaded = set(json.loads(done.stdout))
    assert "httpx2" in loaded
    assert not loaded & UNNEEDED


def test_wrong_options_are_named(subtests) -> None:
    for words, says in [
        (["construct", "--api", "http://127.0.0.1:1"], "needs the database"),
        (["paint"], f"valid queues: {QUEUES}"),
        (["simulate.mujoco", "--concurrency", "2"], "--concurrency: only with --api"),
        (["simulate.mujoco", "--key-file", __file__], "--key-file: only with --api"),
    ]:
        with subtests.test(words=words):
            done = run("admin", "worker", *words)
            assert (done.returncode, says in done.stderr) == (1, True)


def test_the_key_goes_to_no_odd_place_and_unencrypted_only_with_leave(tmp_path) -> None:
    for url in ("ftp://a", "nothing", "http://", "https://u:p@a", "http://10.0.0.1", "http://lab"):
        with pytest.raises(StartupError, match=r"URL of an API|not encrypted"):
            check_url(url, allow_http=False)
    assert check_url("https://lab/", allow_http=False) == "https://lab"
    assert check_url("http://127.0.0.1:8321", allow_http=False) == "http://127.0.0.1:8321"
    assert check_url("http://lab:8321", allow_http=True) == "http://lab:8321"
    (tmp_path / "ca.pem").write_text("nothing")
    for name in ("ca.pem", "none.pem"):
        with pytest.raises(StartupError, match="holds no certificates"):
            tls_context(tmp_path / name)


@pytest.mark.ci
def test_the_doctor_says_what_a_runner_lacks(context, url, tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("BUILDARENA_KEY", ADMIN)
    words = ("admin", "key", "create", "lab", "--scope", "runner")
    assert "names its simulators" in run_cli(url, *words).stderr
    made = json.loads(run_cli(url, *words, "--simulator", "mujoco", "--json").stdout)
    monkeypatch.delenv("BUILDARENA_KEY")

    def checked(secret: str | None, at: str = url) -> dict[str, bool]:
        key = None
        if secret is not None:
            key = tmp_path / "key"
            key.write_text(secret)
        return {check["name"]: check["ok"] for check in check_runner(at, "mujoco", key_file=key)}

    assert checked(made["secret"]) == dict.fromkeys(("simulator", "api", "key", "version"), True)
    for secret in (runner_key(context, "pybullet")[1], None, ADMIN):
        assert not checked(secret)["key"]
    assert not checked("two words")["settings"]
    monkeypatch.setattr("buildarena_simworker.remote.doctor.RETRY_FOR_S", 0.2)
    assert not checked(None, "http://127.0.0.1:9")["api"]
