"""From a submission over the queue and the window of the game to a score that can be verified."""

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace

import pytest
from sqlalchemy import text
from support.game.game_rig import PROGRAMS, Rig, our_score, piloted_text, piloted_trial
from support.programs import variables_of
from support.stages import work

from buildarena_backend.agents.submission import request_trial
from buildarena_backend.catalog.models import load_registry
from buildarena_backend.catalog.specs import JobSpec
from buildarena_backend.jobs.job import Job
from buildarena_backend.process.context import Context, open_context
from buildarena_backend.submission.submission import Submissions
from buildarena_backend.trials.scoring import best_rollout, task_of
from buildarena_benchmark import builtin_tasks, paper_tasks
from buildarena_besiege import read_machine_file
from buildarena_geometry import KeyPress, Machine
from buildarena_simulation import read_trajectory
from buildarena_worker.wiring import verifier

ALL = os.environ.get("BESIEGE_TASKS") == "all"
pytestmark = pytest.mark.timeout(1200 if ALL else 400)
CATEGORIES = ("transport-2", "support-1", "lift-2")
TASKS = tuple(paper_tasks()) if ALL else CATEGORIES[:1]
NEAR = 0.01
"""What a log's four decimals and 25 samples a second leave open, as a share of an indicator."""


@pytest.fixture
def playing(context: Context, rig: Rig, screen: dict[str, str]) -> Iterator[Context]:
    """A service whose queue of the game is served by a runner in a process of its own."""
    # Six times as fast as a game: the log keeps half a second of a large machine's lines then.
    own = replace(rig, patience=2.0, speed=6.0).environment()
    game = {"besiege_game": "1.75-23370", "besiege_mod": "1.4"}
    settings = context.settings.model_copy(update=game)
    environment = {**os.environ, **own, **screen, **variables_of(settings)}
    with (rig.folder / "worker.log").open("wb") as log:
        words = [sys.executable, "-m", "buildarena_simworker", "--simulator", "besiege"]
        runner = subprocess.Popen(words, env=environment, stdout=log, stderr=log)
    service = open_context(settings)
    yield service
    runner.terminate()
    assert runner.wait(timeout=30) == 0, (rig.folder / "worker.log").read_text()
    service.close()


@pytest.mark.ci
def test_each_category_is_played_scored_verified_and_compared(playing, rig) -> None:
    submissions = Submissions(playing, load_registry())
    for task in TASKS:
        submissions.submit_job(JobSpec(task=task, model="builtin/expert", simulator="besiege"))
    jobs = _ended(playing, rig)
    assert {job.task: job.outcome for job in jobs} == dict.fromkeys(TASKS, "success")
    for job in jobs:
        _check(playing, job)
    assert not list(rig.machines.iterdir())
    report = rig.report()
    assert (report["machine"], report["modifiers"]) == (None, [])


def _ended(context: Context, rig: Rig) -> list[Job]:
    ends = time.monotonic() + (1100 if ALL else 350)
    while time.monotonic() < ends:
        work(context, queues=("construct",))
        jobs = context.store.jobs.page(limit=100)
        if all(job.state == "done" for job in jobs):
            return jobs
        time.sleep(0.2)
    raise AssertionError((rig.folder / "worker.log").read_text())


def _check(context: Context, job: Job) -> None:
    """The score is the engine's of the same start; the kept files tell the whole story."""
    record = best_rollout(context.store.rollouts.read(job.id), task_of(job, context.tasks))
    machine = _machine(context, record.machine_hash)
    task = builtin_tasks()[job.task]
    presses = None if record.controls is None else [KeyPress(**one) for one in record.controls]
    ours = our_score(task, machine, controls=presses)
    assert job.success == ours.success
    # A log does not tell which joints hold: what debris carries counts in the game.
    on_debris = ours.metrics.get("load_on_debris")
    told = ours.indicator if on_debris is None else on_debris
    assert job.indicator == pytest.approx(told, rel=NEAR)
    assert job.manifest is not None
    simulator = job.manifest["simulator"]
    assert simulator["simulation"] == "1.75-23370-1.4"
    assert simulator["calibration"]
    assert "/besiege-1.75-23370-1.4/" in job.track
    files = {file.name: file.sha256 for file in context.store.jobs.files(job.id)}
    number = record.number
    kept = {f"machine-{number}.bsg", f"script-{number}.lua", f"log-{number}.txt"}
    assert {*kept, f"trajectory-{number}"} <= set(files)
    read = read_machine_file(context.artifacts.get(files[f"machine-{number}.bsg"])).machine
    assert read.part_count == machine.part_count
    report = verifier(context).verify(job.id).as_document()
    assert any(check["name"].endswith("annotation by mujoco") for check in report["checks"])
    assert report["ok"], [check for check in report["checks"] if not check["ok"]]
    _spoil_log(context, job, f"log-{number}.txt", files[f"log-{number}.txt"])


def _machine(context: Context, digest: str) -> Machine:
    import json

    return Machine.from_document(json.loads(context.artifacts.get(digest)))


def _spoil_log(context: Context, job: Job, name: str, digest: str) -> None:
    """A log with a figure changed by hand is found out."""
    lines = context.artifacts.get(digest).decode().splitlines(keepends=True)
    middle = next(i for i, line in enumerate(lines) if ",s,800," in line)
    fields = lines[middle].split(",")
    fields[-2] = f"{float(fields[-2]) + 1:.4f}"
    lines[middle] = ",".join(fields)
    made = {name: context.artifacts.put("".join(lines).encode(), "text/plain")}
    with context.store.database.transaction() as connection:
        context.store.results.attach(job.id, made, connection=connection)
    report = verifier(context).verify(job.id).as_document()
    failed = [check["name"] for check in report["checks"] if not check["ok"]]
    assert failed, "a changed log passed"


@pytest.mark.ci
def test_programs_are_played_scored_and_verified(playing, rig) -> None:
    """One that drives has a trajectory of what it sensed; one that fails has its log."""
    task, _ = piloted_trial("drives")
    playing.tasks.add(task, piloted_text())
    jobs = {}
    for name in PROGRAMS:
        machine = piloted_trial(name)[1]
        jobs[name], _ = request_trial(playing, machine, task=task.name, simulator="besiege")
    ended = {job.id: job for job in _ended(playing, rig)}
    drives, fails = (ended[jobs[name].id] for name in ("drives", "fails"))
    ours = our_score(*piloted_trial("drives"))
    # Its senses are noisy, and the noise is drawn otherwise than in an engine's trial of our own.
    assert drives.indicator == pytest.approx(ours.indicator, rel=NEAR)
    (record,) = playing.store.rollouts.read(drives.id)
    piloting = read_trajectory(playing.artifacts.get(record.trajectory_hash)).piloting
    assert "marks.goal.relative.x" in piloting.sense_names
    assert piloting.answers[:-1].any(axis=1).all()
    assert (fails.success, fails.indicator) == (False, 0.0)
    assert "line 2, tick 25 (1.00 s): attempt to index" in fails.manifest["simulator"]["refused"]
    assert {"log-0.txt", "script-0.lua"} <= set(playing.store.jobs.artifacts(fails.id))
    for job in (drives, fails):
        report = verifier(playing).verify(job.id).as_document()
        assert report["ok"], [check for check in report["checks"] if not check["ok"]]
    assert "rollout 0: failure" in {check["name"] for check in report["checks"]}
    _pretend(playing, fails, "line 3")
    failed = [check for check in verifier(playing).verify(fails.id).checks if not check.ok]
    assert [check.name for check in failed] == ["rollout 0: failure"]


def _pretend(context: Context, job: Job, line: str) -> None:
    """Has a job's program fail in another line than it did."""
    said = "replace(versions::text, 'line 2', :line)::jsonb"
    with context.store.database.transaction() as connection:
        changes = text(f"UPDATE rollouts SET versions = {said} WHERE job_id = :job")
        connection.execute(changes, {"line": line, "job": job.id})


@pytest.mark.ci
def test_a_job_of_another_version_of_the_game_ends_with_what_to_do(playing, rig) -> None:
    other = open_context(playing.settings.model_copy(update={"besiege_mod": "1.5"}))
    spec = JobSpec(task="lift-1", model="builtin/expert", simulator="besiege")
    Submissions(other, load_registry()).submit_job(spec)
    (job,) = _ended(other, rig)
    other.close()
    assert (job.outcome, job.reason) == ("errored", "game_version")
    assert "1.75-23370-1.5" in str(job.detail)
    assert "submit it again" in str(job.detail)
