import json
import sys
from pathlib import Path

import pytest
from support.clients.commands import run
from support.stages import work

from buildarena_geometry.machine_files import machine_bytes
from buildarena_pipeline.catalog.specs import JobSpec

SUSPENSION_BRIDGE = Path(__file__).parents[2] / "examples" / "tasks" / "suspension-bridge.yaml"


@pytest.fixture
def machine_file(play, tmp_path) -> Path:
    file = tmp_path / "machine.json"
    file.write_bytes(machine_bytes(play("builtin/expert", task="support-1").suspended.machine))
    return file


def test_a_sound_machine_is_called_sound(machine_file) -> None:
    done = run("machine", "check", str(machine_file), "--task", "support-1", "--json")
    found = json.loads(done.stdout)
    assert (done.returncode, found["problems"]) == (0, [])
    assert found["parts"] > 5
    assert "The machine is sound." in run("machine", "check", str(machine_file)).stdout


def test_a_broken_constraint_is_reported(machine_file) -> None:
    done = run("machine", "check", str(machine_file), "--task", str(SUSPENSION_BRIDGE))
    assert done.returncode == 1
    assert "Winch" in done.stdout


@pytest.mark.parametrize(
    ("ending", "begins"), [(".glb", b"glTF"), (".svg", b"<svg"), (".json", b"{")]
)
def test_a_machine_is_written_in_each_format(machine_file, tmp_path, ending, begins) -> None:
    out = tmp_path / f"out{ending}"
    assert run("machine", "export", str(machine_file), "--out", str(out)).returncode == 0
    assert out.read_bytes().startswith(begins)


def test_an_unknown_format_is_refused_with_the_known_ones(machine_file, tmp_path) -> None:
    done = run("machine", "export", str(machine_file), "--out", str(tmp_path / "x.stl"))
    assert (done.returncode, ".glb, .svg, .json" in done.stderr) == (1, True)


@pytest.mark.ci
def test_a_jobs_trial_is_drawn(url, context, submissions, tmp_path) -> None:
    job, _ = submissions.submit_job(
        JobSpec(task="lift-1", model="builtin/expert", simulator="mujoco")
    )
    work(context)
    out = tmp_path / "trial.png"
    done = run("job", "replay", job.id, "--out", str(out), "--url", url)
    assert done.returncode == 0, (done.stdout, done.stderr)
    assert out.read_bytes().startswith(b"\x89PNG")


def test_a_worker_takes_the_commands_place(monkeypatch) -> None:
    started = []
    monkeypatch.setattr("os.execv", lambda *words: started.append(words))
    assert run("admin", "worker", "simulate.mujoco").returncode == 0
    words = [sys.executable, "-m", "buildarena_simworker", "--simulator", "mujoco"]
    assert started == [(sys.executable, words)]
    refused = run("admin", "worker", "paint")
    queues = "construct, simulate.pybullet, simulate.mujoco, simulate.besiege"
    assert (refused.returncode, f"choose from {queues}" in refused.stderr) == (1, True)


@pytest.fixture
def in_folder(tmp_path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


THEIRS = [
    {"op": "start", "params": {"init_shift": [0, 0, 0], "init_rotation": [0, 0, 0]}},
    {"op": "attach_block_to", "params": {"base_block": "1", "face": "f0", "new_block": "Wheel"}},
    {
        "op": "attach_block_to",
        "params": {"base_block": "1", "face": "f1", "new_block": "Single Wooden Block"},
    },
]


def test_a_log_of_another_dialect_is_read_as_what_it_is(tmp_path) -> None:
    log, out = tmp_path / "history.json", tmp_path / "machine.json"
    log.write_text(json.dumps(THEIRS))
    for chosen in ((), ("--dialect", "2.0")):
        assert run("machine", "export", str(log), "--out", str(out), *chosen).returncode == 0
        blocks = json.loads(out.read_text())["blocks"]
        modules = [block["module"] for block in blocks]
        assert modules == ["Starting Block", "Powered Wheel", "Small Wooden Block"]


@pytest.mark.parametrize("command", [("check",), ("export", "--out", "out.glb")])
@pytest.mark.parametrize(
    ("change", "chosen", "says"),
    [
        ({"face": "f9"}, (), "action 3, attach_block_to, is refused"),
        ({"new_block": "Nonsense"}, (), "Nonsense"),
        ({}, ("--dialect", "1.0"), "action 2, attach_block_to, is refused"),
        ({}, ("--dialect", "3.0"), "there is no dialect '3.0'; they are 1.0, 2.0"),
    ],
)
def test_a_refused_action_of_a_log_is_named(in_folder, command, change, chosen, says) -> None:
    actions = [*THEIRS[:2], {**THEIRS[2], "params": {**THEIRS[2]["params"], **change}}]
    (in_folder / "history.json").write_text(json.dumps({"actions": actions}))
    name, *options = command
    done = run("machine", name, "history.json", *options, *chosen)
    assert done.returncode == 1
    assert says in done.stderr
    assert not (in_folder / "out.glb").exists()
