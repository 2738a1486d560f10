"""The command `machine simulate` and `machine render`, without any server."""

import csv
import json
from pathlib import Path

import av
import pytest
from PIL import Image
from support.machines.families import beam
from support.machines.references import actions_of, content_of, load_machine
from typer.testing import CliRunner

from buildarena_cli.commands.machine import app
from buildarena_simulation import read_trajectory

SHORT_TASK = """\
name: short-bridge
title: A bridge for a moment
category: support
statement: |
  A bridge.
scenario:
  duration_s: 1.0
  terrain:
    - {center: [0, -12.5, 2.5], size: [30, 20, 5]}
    - {center: [0, 12.5, 2.5], size: [30, 20, 5]}
  cargo: {size: [2.5, 2.5, 1.5], final_mass: 100, ramp_s: 1}
  placement: {kind: span, gap: 5}
scoring: {name: support, min_time_s: 0.5}
indicator: {name: load, unit: mass units}
"""


@pytest.fixture
def run(tmp_path: Path):
    task = tmp_path / "task.yaml"
    task.write_text(SHORT_TASK, encoding="utf-8")

    def call(*arguments: str, task_name: str = str(task)):
        return CliRunner().invoke(app, [*arguments, "--task", task_name])

    return call


@pytest.fixture
def stored(tmp_path: Path):
    """Writes a stored machine to a file of its own; its name."""

    def write(name: str) -> str:
        file = tmp_path / f"{name}.json"
        file.write_text(json.dumps(content_of(name)), encoding="utf-8")
        return str(file)

    return write


def test_json_tells_the_score_and_nothing_else(run, stored) -> None:
    done = run("simulate", stored("beam"), "--engine", "mujoco", "--json")
    assert done.exit_code == 0, done.output
    report = json.loads(done.stdout)
    assert (report["task"], report["engine"], report["success"]) == ("short-bridge", "mujoco", True)
    assert report["metrics"]["parts"] == 7


def test_a_document_a_log_and_a_bare_list_are_the_same_machine(run, tmp_path) -> None:
    machine = beam(7)
    forms = {
        "document.json": machine.to_document(),
        "list.json": actions_of("beam"),
        "log.json": [{"name": a["op"], "arguments": a["params"]} for a in actions_of("beam")],
    }
    reports = []
    for name, content in forms.items():
        file = tmp_path / name
        file.write_text(json.dumps(content), encoding="utf-8")
        done = run("simulate", str(file), "--engine", "mujoco", "--json")
        reports.append(json.loads(done.stdout))
    assert reports[0] == reports[1] == reports[2]


@pytest.mark.ci
@pytest.mark.parametrize("kind", ["png", "gif", "mp4"])
def test_a_film_shows_the_trial(run, stored, tmp_path, kind) -> None:
    video, data = tmp_path / f"film.{kind}", tmp_path / "beam.parquet"
    file = stored("beam")
    done = run("simulate", file, "--engine", "mujoco", "--trajectory", str(data))
    assert done.exit_code == 0, done.output
    assert len(read_trajectory(data.read_bytes()).time_s) == 26
    done = run("render", file, "--trajectory", str(data), "--video", str(video))
    assert done.exit_code == 0, done.output
    if kind == "mp4":
        with av.open(str(video)) as film:
            frames = [frame.to_image() for frame in film.decode(video=0)]
        assert len(frames) == 26
        picture = frames[0]
    else:
        with Image.open(video) as film:
            assert getattr(film, "n_frames", 1) == (9 if kind == "gif" else 1)
            picture = film.convert("RGB")
    colors = picture.convert("RGB").getcolors(maxcolors=10**6)
    assert colors is not None
    assert len(colors) > 8


def test_a_seed_varies_the_start(run, stored, tmp_path) -> None:
    starts = []
    for more in ([], ["--seed", "1"], ["--seed", "2"]):
        data = tmp_path / "shifted.parquet"
        run(
            "simulate",
            stored("beam"),
            "--engine",
            "mujoco",
            "--trajectory",
            str(data),
            *more,
        )
        starts.append(tuple(read_trajectory(data.read_bytes()).positions[0, 0]))
    assert len(set(starts)) == 3
    assert starts[0][:2] == (0.0, 0.0)
    assert all(abs(x) <= 0.1 and abs(y) <= 0.1 for x, y, _ in starts)


@pytest.mark.ci
def test_seeds_tell_how_often_a_machine_succeeds(run, stored) -> None:
    given = ("simulate", stored("beam-braced-on-top"), "--engine", "mujoco")
    done = run(*given, "--seeds", "3", "--json", task_name="support-1")
    found = json.loads(done.stdout)
    assert (found["trials"], found["successes"], found["robustness"]) == (3, 3, 1.0)
    loads = [result["indicator"] for result in found["results"]]
    assert len(set(loads)) > 1
    assert max(loads) < 1.3 * min(loads)
    short = stored("beam-too-short")
    done = run("simulate", short, "--engine", "mujoco", "--seeds", "2", task_name="support-2")
    assert "0 of 2 succeed" in done.output
    assert "failed seeds" in done.output


def test_seeds_and_a_single_trials_options_exclude_each_other(run, stored) -> None:
    done = run("simulate", stored("beam"), "--seeds", "3", "--seed", "1")
    assert done.exit_code == 1
    assert "--seed" in done.output


def test_an_empty_machine_is_a_failed_trial_not_a_crash(run, tmp_path) -> None:
    file = tmp_path / "empty.json"
    file.write_text("[]", encoding="utf-8")
    done = run("simulate", str(file), "--json")
    assert done.exit_code == 0
    assert json.loads(done.stdout)["success"] is False


@pytest.mark.parametrize(
    ("content", "arguments", "rendered"),
    [
        ("{", [], "not valid JSON"),
        ('{"blocks": 3}', [], "blocks: expected a list"),
        ('{"hello": 1}', [], "neither a machine document nor an action log"),
        ("[]", ["--engine", "havok"], "pybullet, mujoco"),
    ],
)
def test_bad_input_is_reported_in_one_line(run, tmp_path, content, arguments, rendered) -> None:
    file = tmp_path / "machine.json"
    file.write_text(content, encoding="utf-8")
    if "--engine" in arguments:
        file.write_text(json.dumps(beam(3).to_document()), encoding="utf-8")
    done = run("simulate", str(file), *arguments)
    assert done.exit_code == 1
    assert rendered in done.output
    assert "Traceback" not in done.output


def test_an_unknown_task_is_reported_with_the_known_ones(run, stored) -> None:
    done = run("simulate", stored("beam"), task_name="support-9")
    assert done.exit_code == 1
    assert "support-3" in done.output


@pytest.mark.parametrize("form", ["log", "document"])
def test_a_machine_that_breaks_a_constraint_is_not_simulated(run, tmp_path, form) -> None:
    name = "rule-breakers/loose-cannon"
    machine = load_machine(name)
    content = actions_of(name) if form == "log" else machine.to_document()
    file = tmp_path / "loose.json"
    file.write_text(json.dumps(content), encoding="utf-8")
    done = run("simulate", str(file), "--json", task_name="lift-2")
    assert done.exit_code == 0
    assert "not simulated: unjoined_parts: block 2 (Water Cannon) is not joined" in done.stderr
    report = json.loads(done.stdout)
    assert (report["success"], report["indicator"], report["engine"]) == (False, 0.0, None)
    repeated = run("simulate", str(file), "--seeds", "3", "--json", task_name="lift-2")
    assert json.loads(repeated.stdout)["successes"] == 0
    checked = run("check", str(file), task_name="lift-2")
    assert checked.exit_code == 1


def test_an_assembly_with_too_few_sub_structures_is_not_simulated(run, stored) -> None:
    done = run("simulate", stored("rocket-two"), "--json", task_name="lift-3")
    assert "the machine has 1 sub-structure, the task asks for 2" in done.stderr
    assert json.loads(done.stdout)["success"] is False
    fine = run("check", stored("assembly-braced"), task_name="lift-3")
    assert fine.exit_code == 0, fine.output


CONTROL = Path(__file__).parents[2] / "examples" / "control"


def controlled(run, program: Path, task_name: str, *more: str):
    car = str(CONTROL / "car.machine.json")
    more = ("--controller", str(program), "--engine", "mujoco", *more)
    return run("simulate", car, *more, task_name=task_name)


def test_a_program_acts_in_place_of_keys(run, tmp_path) -> None:
    task = str(CONTROL / "to-the-mark.yaml")
    done = controlled(run, CONTROL / "to-the-mark.lua", task, "--json")
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["success"]

    wrong = tmp_path / "wrong.lua"
    wrong.write_text("function control(t, sense)\n  return { forwards = sense.goal.x }\nend\n")
    failed = controlled(run, wrong, task)
    assert "line 2, tick 0 (0.00 s): attempt to index field 'goal' (a nil value)" in failed.stderr
    wrong.write_text("function control(t, sense) return { spining_forward = 1 } end")
    assert "there is spinning_forward" in controlled(run, wrong, task).stderr
    refused = controlled(run, CONTROL / "to-the-mark.lua", "transport-1")
    assert "the task offers no senses: it takes keys alone" in refused.stderr


def test_what_a_program_sensed_is_written_tick_by_tick(run, tmp_path) -> None:
    out = tmp_path / "trace.csv"
    task = str(CONTROL / "to-the-mark.yaml")
    done = controlled(run, CONTROL / "to-the-mark.lua", task, "--trace", str(out))
    assert done.exit_code == 0, done.output
    head, *rows = list(csv.reader(out.read_text().splitlines()))
    assert head[:2] == ["t", "position.x"]
    assert "marks.goal.relative.y" in head
    assert any(name.endswith(".spinning_forward") for name in head)
    assert [float(row[0]) for row in rows] == pytest.approx([k / 25 for k in range(500)])
    keys = run("simulate", str(CONTROL / "car.machine.json"), "--trace", str(out), task_name=task)
    assert keys.exit_code != 0
    assert "the machine has none: --controller" in keys.stderr


@pytest.mark.parametrize(
    ("content", "words"),
    [(None, "No such file"), ("x" * 70_000, "at most 65,536 bytes, found 70,000")],
)
def test_a_program_that_cannot_be_taken_is_refused(run, tmp_path, content, words) -> None:
    program = tmp_path / "program.lua"
    if content is not None:
        program.write_text(content)
    done = controlled(run, program, str(CONTROL / "to-the-mark.yaml"))
    assert done.exit_code != 0
    assert words in done.stderr or words in str(done.exception)


def test_the_documentation_shows_the_example_as_it_is() -> None:
    page = (CONTROL.parents[1] / "docs" / "control.md").read_text(encoding="utf-8")
    assert (CONTROL / "to-the-mark.lua").read_text(encoding="utf-8") in page
    task = (CONTROL / "to-the-mark.yaml").read_text(encoding="utf-8")
    senses = page.split("```yaml\n")[1].split("```")[0].split("\n", 2)[2]
    assert senses in task
