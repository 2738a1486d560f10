"""The game played by the toolkit's command line: a real program that plays our engine."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import psutil
import pytest
from game_rig import GAME, MOD, SUPPORT, VERSION, experts_machine, our_score, short_trial, trial_of
from support.stages import work

from buildarena_benchmark import builtin_tasks, score
from buildarena_besiege import logged_trajectory
from buildarena_geometry import KeyPress, Machine
from buildarena_pipeline.catalog.models import load_registry
from buildarena_pipeline.catalog.specs import JobSpec
from buildarena_pipeline.errors import PermanentError
from buildarena_pipeline.runtime.context import Context, open_context
from buildarena_pipeline.runtime.scoring import best_rollout, task_of
from buildarena_pipeline.runtime.simulators.simulator import SimulatorFaultError
from buildarena_pipeline.runtime.trial_checks import checked_trajectory, checked_versions
from buildarena_pipeline.submission.submission import Submissions
from buildarena_simulation import write_trajectory
from buildarena_simworker_besiege.doctor import examine
from buildarena_simworker_besiege.errors import NotSetUpError
from buildarena_simworker_besiege.settings import BesiegeSettings
from buildarena_simworker_besiege.toolkit.simulator import ToolkitSimulator
from buildarena_worker.wiring import verifier

pytestmark = [pytest.mark.nightly, pytest.mark.timeout(200)]


def environment(folder: Path) -> dict[str, str]:
    words = [
        *(sys.executable, "-m", "stand_in_toolkit", "run", "--bsg", "{bsg}"),
        *("--controller", "{controller}", "--sandbox", "{sandbox}", "--telemetry-hz", "{hz}"),
        *("--output", "{folder}", "--duration", "{duration}"),
        *("--faults", str(folder / "faults.json"), "--pids", str(folder / "pids")),
    ]
    return {
        "BUILDARENA_BESIEGE_DRIVER": "toolkit",
        "BUILDARENA_BESIEGE_GAME": GAME,
        "BUILDARENA_BESIEGE_MOD": MOD,
        "BUILDARENA_BESIEGE_STATE": str(folder / "state"),
        "BUILDARENA_BESIEGE_COMMAND": " ".join(words),
        "PYTHONPATH": SUPPORT,
    }


@pytest.fixture
def toolkit(tmp_path: Path, monkeypatch) -> BesiegeSettings:
    for name, value in environment(tmp_path).items():
        monkeypatch.setenv(name, value)
    return BesiegeSettings()


@pytest.fixture
def simulator(toolkit: BesiegeSettings) -> Iterator[ToolkitSimulator]:
    simulator = ToolkitSimulator(toolkit)
    yield simulator
    simulator.close()


@pytest.fixture
def faults(tmp_path: Path):
    def strike(*names: str) -> None:
        (tmp_path / "faults.json").write_text(json.dumps(names))

    return strike


def test_a_car_is_driven_as_by_our_engine(simulator) -> None:
    task, machine = short_trial("transport-1")
    done = simulator.run(trial_of(task, machine))
    right, result = our_score(task, machine), score(task, machine, done.trajectory)
    assert result.success == right.success
    assert result.indicator == pytest.approx(right.indicator, rel=0.01)
    assert done.versions["driver"] == "toolkit"
    assert done.versions["unknown_columns"] == ["sample_index", "input_keys_held"]
    timeline = json.loads(done.files["timeline-0.json"].data)
    assert timeline["schema"] == "buildarena.control_timeline.v2"
    assert {event["channel"] for event in timeline["events"]} <= {"ForwardKey", "BackwardKey"}
    # The API takes it, and `verify` finds the same trajectory in the stored log.
    sent = write_trajectory(done.trajectory)
    wanted = {"simulator": "besiege", "machine": machine, "scenario": task.scenario}
    assert write_trajectory(checked_trajectory(sent, version=VERSION, **wanted)) == sent
    checked_versions(
        done.versions, simulator="besiege", version=VERSION, trajectory=done.trajectory
    )
    text = done.files["log-0.txt"].data.decode()
    again = logged_trajectory(text, done.versions, machine, task.scenario)
    assert write_trajectory(again) == sent


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("fault", ["reordered", "other_names"])
def test_columns_are_found_by_name(simulator, faults, fault) -> None:
    faults(fault)
    task, machine = short_trial("transport-1")
    done = simulator.run(trial_of(task, machine))
    assert "faults" not in done.versions
    right = our_score(task, machine)
    assert score(task, machine, done.trajectory).indicator == pytest.approx(
        right.indicator, rel=0.01
    )


FAULTS = {
    "crash": "ended with code 3: fatal: the game closed",
    "not_ok": "its result is 'timeout', not 'ok'",
    "no_result": "its result is 'None'",
    "truncated": "cut off",
    "nan": "x is 'nan', which is not a number",
    "renamed": "No column of the telemetry is its y",
    "twice": "Several columns of the telemetry may be its x",
    "short": "nothing is told of block",
    "gap": "nothing is told of block",
    "backwards": "do not rise",
    "other_blocks": "tells nothing of block 1",
    "one_block": "tells nothing of block",
    "other_machine": "the machine was",
    "other_keys": "the controller was",
    "other_sandbox": "the sandbox was 'LONE ORB', which is another",
    "other_rate": "the rate was '10'",
    "silent": "input_manifest.json names no controller",
    "link": "input_manifest.json is not a file",
    "not_json": "input_manifest.json is not valid JSON",
    "two_runs": "there are 2 new runs",
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_once_is_got_over_and_named(simulator, faults, fault) -> None:
    faults(fault)
    task, machine = short_trial("transport-1")
    done = simulator.run(trial_of(task, machine))
    (named,) = done.versions["faults"]
    assert FAULTS[fault] in named
    assert score(task, machine, done.trajectory).indicator > 1.0


def test_a_fault_that_stays_is_a_fault_and_no_score(simulator, faults) -> None:
    faults("crash", "crash", "nan")
    task, machine = short_trial("transport-1")
    with pytest.raises(SimulatorFaultError, match="ended with code 3") as failed:
        simulator.run(trial_of(task, machine))
    assert "which is not a number" in str(failed.value)
    assert list(failed.value.files) == ["output-0-1.txt"]


def is_gone(pid: int) -> bool:
    """Whether a process has ended, waited for a little."""
    try:
        psutil.Process(pid).wait(5)
    except psutil.NoSuchProcess:
        return True
    except psutil.TimeoutExpired:
        return False
    return True


def started(folder: Path) -> tuple[int, int]:
    """The stand-in's own process and the one that it started, once it did."""
    ends = time.monotonic() + 60
    while not (folder / "pids").exists():
        assert time.monotonic() < ends
        time.sleep(0.05)
    own, other = json.loads((folder / "pids").read_text())
    return own, other


def test_what_hangs_is_ended_with_all_it_started(toolkit, faults, tmp_path) -> None:
    faults("hang", "orphan")
    impatient = toolkit.model_copy(update={"patience": 0.01})
    simulator = ToolkitSimulator(impatient)
    task, machine = short_trial("transport-1")
    short = task.scenario.model_copy(update={"duration_s": 1.0})
    done = simulator.run(trial_of(replace(task, scenario=short), machine))
    (named,) = done.versions["faults"]
    assert "no end after 12 s" in named
    assert is_gone(started(tmp_path)[1]), "what the second run left behind was ended, too"


def test_a_lost_lease_ends_the_run_and_all_it_started(simulator, faults, tmp_path) -> None:
    faults("hang")
    task, machine = short_trial("transport-1")

    class LeaseLostError(Exception):
        pass

    def require_held() -> None:
        if (tmp_path / "pids").exists():
            time.sleep(0.6)
            raise LeaseLostError

    trial = replace(trial_of(task, machine), require_held=require_held)
    with pytest.raises(LeaseLostError):
        simulator.run(trial)
    assert is_gone(started(tmp_path)[1])


@pytest.mark.parametrize("name", ["support-1", "transport-2", "lift-1", "lift-2"])
def test_what_telemetry_cannot_tell_is_refused_with_the_reason(simulator, name) -> None:
    task, machine = builtin_tasks()[name], experts_machine(name)
    with pytest.raises(PermanentError, match="telemetry tells poses only"):
        simulator.run(trial_of(task, machine))


@pytest.mark.parametrize(
    ("command", "says"),
    [
        ("/nowhere/besiege_cli --bsg {bsg} --controller {controller} {sandbox}", "no program"),
        (f"{sys.executable} -m besiege_cli run --bsg {{bsg}}", "{controller}, {sandbox}"),
        (
            f"{sys.executable} -m x --bsg {{bsg}} --controller {{controller}} {{sandbox}}",
            "leaves its runs is not known",
        ),
    ],
)
def test_the_doctor_says_what_is_missing(toolkit, command, says) -> None:
    wrong = toolkit.model_copy(update={"command": command})
    with pytest.raises(NotSetUpError, match=says.replace("{", r"\{")):
        ToolkitSimulator(wrong)
    (point,) = [point for point in examine(wrong) if point.name == "toolkit"]
    assert not point.ok
    assert says in point.detail
    assert all(point.ok for point in examine(toolkit))


def test_a_killed_runner_leaves_nothing_and_the_next_one_plays(toolkit, faults, tmp_path) -> None:
    """Its command and all that started still run; the next runner ends them first."""
    faults("hang")
    words = [sys.executable, "-m", "one_toolkit_run"]
    killed = subprocess.Popen(words, stdout=subprocess.PIPE)
    _, pid = started(tmp_path)
    time.sleep(1.0)
    killed.kill()
    killed.communicate()
    assert psutil.pid_exists(pid)
    done = subprocess.run(words, capture_output=True, text=True, timeout=100, check=True)
    assert is_gone(pid)
    task, machine = short_trial("transport-1")
    right = our_score(task, machine)
    assert json.loads(done.stdout) == pytest.approx(right.indicator, rel=0.01)
    assert len(list((toolkit.state / "toolkit").iterdir())) == 1


@pytest.fixture
def playing(context: Context, tmp_path: Path) -> Iterator[Context]:
    """A service whose queue of the game is served by a runner with the toolkit."""
    chosen = context.settings.model_copy(update={"besiege_game": GAME, "besiege_mod": MOD})
    own = {
        **os.environ,
        **environment(tmp_path),
        "BUILDARENA_DATABASE_URL": chosen.required_database_url(),
        "BUILDARENA_BROKER_URL": chosen.required_broker_url(),
        "BUILDARENA_DATA": str(chosen.data),
    }
    words = [sys.executable, "-m", "buildarena_simworker", "--simulator", "besiege"]
    with (tmp_path / "worker.log").open("wb") as output:
        runner = subprocess.Popen(words, env=own, stdout=output, stderr=output)
    service = open_context(chosen)
    yield service
    runner.terminate()
    assert runner.wait(timeout=30) == 0, (tmp_path / "worker.log").read_text()
    service.close()


def test_a_submission_is_played_scored_and_verified(playing, faults, tmp_path) -> None:
    faults("other_machine", "hang")
    spec = JobSpec(task="transport-1", model="builtin/expert", simulator="besiege")
    Submissions(playing, load_registry()).submit_job(spec)
    ends = time.monotonic() + 150
    hung = True
    while not all(job.state == "done" for job in playing.store.jobs.page(limit=10)):
        assert time.monotonic() < ends, (tmp_path / "worker.log").read_text()
        if hung and (tmp_path / "pids").exists():
            # Only the program itself, once: what it started is then another's child.
            psutil.Process(started(tmp_path)[0]).kill()
            hung = False
        work(playing, queues=("construct",))
        time.sleep(0.2)
    (job,) = playing.store.jobs.page(limit=10)
    record = best_rollout(playing.store.rollouts.read(job.id), task_of(job, playing.tasks))
    machine = Machine.from_document(json.loads(playing.artifacts.get(record.machine_hash)))
    presses = None if record.controls is None else [KeyPress(**one) for one in record.controls]
    right = our_score(builtin_tasks()["transport-1"], machine, controls=presses)
    assert (job.outcome, job.success) == ("success", right.success)
    assert job.indicator == pytest.approx(right.indicator, rel=0.01)
    simulator = job.manifest["simulator"]
    assert simulator["driver"] == "toolkit"
    files = {file.name: file.hash for file in playing.store.jobs.files(job.id)}
    assert {"machine-0.bsg", "timeline-0.json", "summary-0.json", "log-0.txt"} <= set(files)
    report = verifier(playing).verify(job.id).as_document()
    assert report["ok"], [check for check in report["checks"] if not check["ok"]]
    _spoil(playing, job.id, files["log-0.txt"])
    report = verifier(playing).verify(job.id).as_document()
    assert not report["ok"], "changed telemetry passed"


def _spoil(context: Context, job: str, digest: str) -> None:
    """Moves a block a little in one row of the stored telemetry."""
    lines = context.artifacts.get(digest).decode().split("\n")
    fields = lines[500].split(",")
    fields[4] = f"{float(fields[4]) + 1:.4f}"
    lines[500] = ",".join(fields)
    made = {"log-0.txt": context.artifacts.put("\n".join(lines).encode(), "text/plain")}
    with context.store.database.transaction() as connection:
        context.store.results.attach(job, made, connection=connection)
