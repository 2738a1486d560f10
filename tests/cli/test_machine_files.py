"""Commands of machines and tasks: check without a server, write, try with keys, add and show."""

import json
import sys
from pathlib import Path

import pytest
from support.clients.commands import printed, run, run_cli
from support.machines.building import experts_machine
from support.stages import work

from buildarena_api.routes.tasks import EXAMPLE
from buildarena_backend.catalog.specs import JobSpec
from buildarena_besiege import MachineNotPlayableError, read_any_machine, remap_keys
from buildarena_geometry.keys import KEYS
from buildarena_geometry.machine_files import machine_bytes

SUSPENSION_BRIDGE = Path(__file__).parents[2] / "examples" / "tasks" / "suspension-bridge.yaml"


@pytest.fixture
def machine_file(tmp_path) -> Path:
    file = tmp_path / "machine.json"
    file.write_bytes(machine_bytes(experts_machine("support-1")))
    return file


def test_a_machine_is_checked_and_written_in_each_format(machine_file, tmp_path) -> None:
    done = run("machine", "check", str(machine_file), "--task", "support-1", "--json")
    found = json.loads(done.stdout)
    assert (done.returncode, found["problems"]) == (0, [])
    assert found["parts"] > 5
    done = run("machine", "check", str(machine_file), "--task", str(SUSPENSION_BRIDGE))
    assert (done.returncode, "Winch" in done.stdout) == (1, True)
    for ending, begins in ((".glb", b"glTF"), (".svg", b"<svg"), (".json", b"{")):
        out = tmp_path / f"out{ending}"
        assert run("machine", "export", str(machine_file), "--out", str(out)).returncode == 0
        assert out.read_bytes().startswith(begins)
    done = run("machine", "export", str(machine_file), "--out", str(tmp_path / "x.stl"))
    assert (done.returncode, ".glb, .svg, .json" in done.stderr) == (1, True)


@pytest.mark.ci
def test_a_jobs_trial_is_drawn(url, context, submissions, tmp_path) -> None:
    spec = JobSpec(task="lift-1", model="builtin/expert", simulator="mujoco")
    job, _ = submissions.submit_job(spec)
    work(context)
    out = tmp_path / "trial.png"
    printed(url, "job", "replay", job.id, "--out", str(out))
    assert out.read_bytes().startswith(b"\x89PNG")


def test_a_worker_takes_the_commands_place(monkeypatch) -> None:
    started = []
    monkeypatch.setattr("os.execv", lambda *words: started.append(words))
    assert run("admin", "worker", "simulate.mujoco").returncode == 0
    words = [sys.executable, "-m", "buildarena_simworker", "--simulator", "mujoco"]
    assert started == [(sys.executable, words)]


def test_a_log_of_another_dialect_is_read_as_what_it_is(tmp_path) -> None:
    attach = {"base_block": "1", "face": "f1", "new_block": "Single Wooden Block"}
    theirs = [
        {"op": "start", "params": {"init_shift": [0, 0, 0], "init_rotation": [0, 0, 0]}},
        {"op": "attach_block_to", "params": attach},
    ]
    log, out = tmp_path / "history.json", tmp_path / "machine.json"
    log.write_text(json.dumps(theirs))
    assert run("machine", "export", str(log), "--out", str(out)).returncode == 0
    modules = [block["module"] for block in json.loads(out.read_text())["blocks"]]
    assert modules == ["Starting Block", "Small Wooden Block"]


# Machines of the game's files are tried with their own keys, whichever the game has

MACHINES = Path(__file__).parents[1] / "data" / "own_keys"
THREE, FIVE = (MACHINES / name / "machine_tuned.bsg" for name in ("three_blocks", "five_blocks"))
SHORT_ORBIT = """
name: short-orbit
title: Up
category: space
level: 1
statement: Fly. Keys are bound to the actions of blocks.
scenario:
  duration_s: 2
  gravity: 23
  control: {mode: agent}
  planet: {radius: 600, air: 0.86, air_height: 342}
scoring: {name: orbit}
indicator: {name: pace, unit: cycles/min}
constraints: {modules: [Steering Thruster]}
"""


def test_a_contestant_sees_which_way_each_key_pushes(tmp_path) -> None:
    task, keys = tmp_path / "orbit.yaml", tmp_path / "keys.json"
    task.write_text(SHORT_ORBIT)
    for machine, key, low, high, told in (
        (THREE, "M3", 60, 1e9, "M3: 2 thrust_left (pushes it <Up>)"),
        (FIVE, "M3", 60, 1e9, "(simulated as 3)"),
        (THREE, "M4", 0, 1, "M4: 2 thrust_right (pushes it <Down>), 3 thrust_right"),
        (THREE, "Z", None, None, "expected one of E, M3, Q, M4, UpArrow"),
    ):
        keys.write_text(json.dumps([{"time": 0, "key": key, "hold_for": 2}]))
        command = ("machine", "simulate", str(machine), "--task", str(task))
        command += ("--key-presses", str(keys))
        done = run(*command, "--json")
        assert (done.returncode, told in done.stderr) == (low is None, True), done.stderr
        if low is not None:
            assert low <= json.loads(done.stdout)["metrics"]["greatest_height"] <= high


def test_own_keys_take_none_that_is_used_already_and_no_more_than_there_are() -> None:
    text = THREE.read_text()
    used = text.replace("<String>M3<", "<String>UpArrow<")
    machine, keys = remap_keys(read_any_machine(used.encode(), where="three"))
    assert keys["UpArrow"] == "UpArrow"
    assert len(set(keys.values())) == len(keys) == 4
    assert machine.blocks["2"].bindings["thrust_left"] == ("UpArrow", keys["E"])
    names = [f"F{k}" for k in range(1, 16)] + list("ABCDEFGHIJK")
    many = text.replace("<String>M4<", f"<String>{'</String><String>'.join(names)}<")
    with pytest.raises(MachineNotPlayableError, match=f"{len(KEYS)} are free"):
        remap_keys(read_any_machine(many.encode(), where="three"))


# Tasks


def test_check_and_add_say_the_same_faults(url, tmp_path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text(EXAMPLE)
    done = run("task", "check", str(file), "--json")
    answer = json.loads(done.stdout)
    assert (done.returncode, answer["ok"], answer["name"]) == (0, True, "narrow-gap")
    wrong = EXAMPLE.replace("gap: 3}", "gap: -3}").replace("{name: support}", "{name: suport}")
    for text, says in (
        ("a: &a [x]\nb: *a\n", [f"{file}:1: anchors and aliases"]),
        (EXAMPLE.replace("narrow-gap", "lift-1"), [f"{file}:1: name: lift-1 is a built-in task"]),
        (wrong, [f"{file}:12: scenario.placement.gap: ", f"{file}:13: scoring: "]),
    ):
        file.write_text(text)
        checked, added = run("task", "check", str(file)), run_cli(url, "task", "add", str(file))
        assert checked.returncode == added.returncode == 1
        assert checked.stderr == added.stderr
        assert [part for part in says if part not in checked.stderr] == []
    done = run("task", "check", str(file), "--json")
    errors = json.loads(done.stdout)["errors"]
    assert (done.returncode, [error["line"] for error in errors]) == (1, [12, 13])


def test_added_tasks_are_listed_and_shown(url, tmp_path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text(EXAMPLE.replace("A bridge over a gap of 3", '"[/red] [bold]gap"'))
    version = json.loads(printed(url, "task", "add", str(file), "--json"))["version"]
    text = printed(url, "task", "list")
    assert "narrow-gap+" in text
    assert "support-1+" not in text
    assert "[/red] [bold]gap" in text, "a title is not taken for markup"
    shown = printed(url, "task", "show", "narrow-gap")
    assert f"narrow-gap, version {version}, added by a user" in shown
    done = run_cli(url, "task", "show", "nowhere")
    assert (done.returncode, "valid tasks: transport-1" in done.stderr) == (1, True)
