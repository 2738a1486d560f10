"""The command `machine simulate` and `machine render`, without any server."""

import csv
import json
from pathlib import Path

import av
import pytest
from support.machines.families import beam
from support.machines.references import content_of, load_machine
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


@pytest.mark.ci
@pytest.mark.parametrize(("kind", "count"), [("png", 1), ("mp4", 26)])
def test_a_film_shows_the_trial(run, stored, tmp_path, kind, count) -> None:
    video, data, file = tmp_path / f"film.{kind}", tmp_path / "beam.parquet", stored("beam")
    words = ("--engine", "mujoco", "--trajectory", str(data), "--video", str(video))
    done = run("simulate", file, *words)
    assert done.exit_code == 0, done.output
    assert len(read_trajectory(data.read_bytes()).time_s) == 26
    with av.open(str(video)) as film:
        frames = [frame.to_image() for frame in film.decode(video=0)]
    assert len(frames) == count
    assert len(frames[0].convert("RGB").getcolors(maxcolors=10**6)) > 8


def test_a_seed_varies_the_start(run, stored, tmp_path) -> None:
    starts = []
    for more in ([], ["--seed", "1"], ["--seed", "2"]):
        data = tmp_path / "shifted.parquet"
        asked = ("--engine", "mujoco", "--trajectory", str(data))
        assert run("simulate", stored("beam"), *asked, *more).exit_code == 0
        starts.append(tuple(read_trajectory(data.read_bytes()).positions[0, 0]))
    assert len(set(starts)) == 3
    assert starts[0][:2] == (0.0, 0.0)
    assert all(abs(x) <= 0.1 and abs(y) <= 0.1 for x, y, _ in starts)


@pytest.mark.ci
def test_seeds_tell_how_often_a_machine_succeeds(run, stored) -> None:
    given = ("simulate", stored("beam-braced-on-top"), "--engine", "mujoco")
    done = run(*given, "--repeat", "3", "--json", task_name="support-1")
    found = json.loads(done.stdout)
    assert (found["trials"], found["successes"], found["robustness"]) == (3, 3, 1.0)
    loads = [result["indicator"] for result in found["results"]]
    assert len(set(loads)) > 1
    assert max(loads) < 1.3 * min(loads)
    short = stored("beam-too-short")
    done = run("simulate", short, "--engine", "mujoco", "--repeat", "2", task_name="support-2")
    assert "0 of 2 succeed" in done.output
    assert "failed seeds" in done.output


def test_an_empty_machine_is_a_failed_trial_and_bad_input_one_line(run, tmp_path) -> None:
    file = tmp_path / "machine.json"
    file.write_text("[]", encoding="utf-8")
    done = run("simulate", str(file), "--json")
    assert (done.exit_code, json.loads(done.stdout)["success"]) == (0, False)
    beam_of_3 = json.dumps(beam(3).to_document())
    for content, arguments, task, rendered in (
        ("{", [], {}, "not valid JSON"),
        ('{"blocks": 3}', [], {}, "blocks: expected a list"),
        ('{"hello": 1}', [], {}, "neither a machine document nor an action log"),
        (beam_of_3, ["--engine", "havok"], {}, "pybullet, mujoco"),
        (beam_of_3, ["--repeat", "3", "--seed", "1"], {}, "--seed"),
        (beam_of_3, [], {"task_name": "support-9"}, "support-3"),
    ):
        file.write_text(content, encoding="utf-8")
        done = run("simulate", str(file), *arguments, **task)
        assert done.exit_code == 1
        assert rendered in done.output
        assert "Traceback" not in done.output


def test_a_machine_that_breaks_a_constraint_is_not_simulated(run, tmp_path) -> None:
    file = tmp_path / "loose.json"
    document = load_machine("rule-breakers/loose-cannon").to_document()
    file.write_text(json.dumps(document), encoding="utf-8")
    done = run("simulate", str(file), "--json", task_name="lift-2")
    assert done.exit_code == 0
    assert "not simulated: unjoined_parts: block 2 (Water Cannon) is not joined" in done.stderr
    report = json.loads(done.stdout)
    assert (report["success"], report["indicator"], report["engine"]) == (False, 0.0, None)
    repeated = run("simulate", str(file), "--repeat", "3", "--json", task_name="lift-2")
    assert json.loads(repeated.stdout)["successes"] == 0
    checked = run("check", str(file), task_name="lift-2")
    assert checked.exit_code == 1


CONTROL = Path(__file__).parents[2] / "examples" / "control"


def controlled(run, program: Path, task_name: str, *more: str):
    car = str(CONTROL / "car.machine.json")
    more = ("--controller", str(program), "--engine", "mujoco", *more)
    return run("simulate", car, *more, task_name=task_name)


def test_a_program_acts_in_place_of_keys_and_is_traced(run, tmp_path) -> None:
    task = str(CONTROL / "to-the-mark.yaml")
    out = tmp_path / "trace.csv"
    done = controlled(run, CONTROL / "to-the-mark.lua", task, "--json", "--trace", str(out))
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["success"]
    head, *rows = list(csv.reader(out.read_text().splitlines()))
    assert head[:2] == ["t", "position.x"]
    assert "marks.goal.relative.y" in head
    assert any(name.endswith(".spinning_forward") for name in head)
    assert [float(row[0]) for row in rows] == pytest.approx([k / 25 for k in range(500)])
    keys = run("simulate", str(CONTROL / "car.machine.json"), "--trace", str(out), task_name=task)
    assert keys.exit_code != 0
    assert "the machine has none: --controller" in keys.stderr
    wrong = tmp_path / "wrong.lua"
    wrong.write_text("function control(t, sense)\n  return { forwards = sense.goal.x }\nend\n")
    failed = controlled(run, wrong, task)
    assert "line 2, tick 0 (0.00 s): attempt to index field 'goal' (a nil value)" in failed.stderr
    missing = controlled(run, tmp_path / "none.lua", task)
    assert "No such file" in missing.stderr + str(missing.exception)
