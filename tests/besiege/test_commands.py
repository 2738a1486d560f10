"""The commands `machine export` and `besiege`."""

import json
from pathlib import Path

import pytest
from support.lua_game import LuaGame
from support.machine_files import published_files
from tests.besiege.playing import vehicle
from tests.besiege.test_reading_files import assert_alike, contents
from typer.testing import CliRunner

from buildarena_benchmark import builtin_tasks
from buildarena_besiege import read_machine_file, run_ids
from buildarena_besiege.importing.xml_file import parse_file
from buildarena_cli.main import app
from buildarena_geometry import Machine


def run(*words: object):
    return CliRunner().invoke(app, [str(word) for word in words])


@pytest.fixture
def machine(tmp_path: Path) -> Path:
    file = tmp_path / "machine.json"
    document = vehicle(cannon=True).to_document()
    document["control_sequence"] = [{"time_s": 1.0, "key": "UpArrow", "hold_for_s": 20.0}]
    file.write_text(json.dumps(document), encoding="utf-8")
    return file


def test_a_machine_goes_into_a_file_of_the_game_and_comes_back(machine, tmp_path) -> None:
    file, back = tmp_path / "my-machine.bsg", tmp_path / "back.json"
    assert run("machine", "export", machine, "--out", file, "--task", "transport-2").exit_code == 0
    done = run("machine", "export", file, "--out", back)
    assert (done.exit_code, "a cargo is the task's" in done.stderr) == (0, True)
    ours = Machine.from_document(json.loads(machine.read_text()))
    assert_alike(contents(Machine.from_document(json.loads(back.read_text()))), contents(ours))
    assert run("machine", "export", machine, "--out", file).exit_code == 0
    plain = run("machine", "check", file)
    assert (plain.exit_code, plain.stderr) == (0, "")


CONTROL = Path(__file__).parents[2] / "examples/control"


def test_a_program_goes_into_the_script_and_comes_back(tmp_path) -> None:
    machine, task = CONTROL / "car.machine.json", CONTROL / "to-the-mark.yaml"
    own, file = tmp_path / "own.json", tmp_path / "m.bsg"
    program = CONTROL / "to-the-mark.lua"
    words = ("machine", "export", machine, "--out", file, "--controller", program)
    done = run(*words, "--task", task)
    assert done.exit_code == 0, done.output
    back = run("machine", "export", file, "--out", own)
    assert (back.exit_code, back.stderr) == (0, "")
    controlled = Machine.from_document(json.loads(own.read_text()))
    assert controlled.controller == program.read_text(encoding="utf-8")
    refused = run(*words)
    assert (refused.exit_code, "name a task" in refused.stderr) == (1, True)
    refused = run(*words, "--task", "transport-1")
    assert (refused.exit_code, "takes keys alone" in refused.stderr) == (1, True)


def test_other_keys_may_be_pressed(machine, tmp_path) -> None:
    controls = tmp_path / "controls.json"
    controls.write_text('[{"time": 2, "key": "Alpha2", "hold_for": 1.5}]', encoding="utf-8")
    file = tmp_path / "m.bsg"
    for task in (("--task", "transport-1"), ()):
        done = run("machine", "export", machine, "--out", file, "--key-presses", controls, *task)
        assert done.exit_code == 0, done.output
        (press,) = read_machine_file(file.read_bytes()).machine.control_sequence
        assert (press.key, press.time_s, press.hold_for_s) == ("Alpha2", 2, 1.5)
    controls.write_text('[{"time": 2, "key": "Z", "hold_for": 1.5}]', encoding="utf-8")
    done = run("machine", "export", machine, "--out", file, "--key-presses", controls)
    assert (done.exit_code, "expected one of UpArrow" in done.stderr) == (1, True)


def test_wrong_words_are_named(machine, tmp_path, monkeypatch, subtests) -> None:
    for words, says in [
        (("--out", "x.stl"), ".glb, .svg, .json, .bsg"),
        (("--out", "x.glb", "--task", "lift-1"), "--task is for .bsg files"),
        (("--out", "Big Name.bsg"), "lower case letters"),
        (("--out", "x.bsg", "--task", "lift-9"), "unknown task 'lift-9'"),
    ]:
        with subtests.test(words=words):
            monkeypatch.chdir(tmp_path)
            done = run("machine", "export", machine, *words)
            assert (done.exit_code, says in done.stderr) == (1, True), done.stderr


def test_machine_files_are_read_wherever_machines_are(tmp_path) -> None:
    file = tmp_path / "published.bsg"
    file.write_bytes(published_files()["single_1_plain_none"])
    done = run("machine", "check", file)
    assert (done.exit_code, "25 parts" in done.stdout) == (1, True)
    assert "the Lua script is not ours" in done.stderr
    assert run("machine", "export", file, "--out", tmp_path / "x.glb").exit_code == 0
    file.write_bytes(b"<Machine/>")
    done = run("machine", "check", file)
    assert (done.exit_code, "no blocks" in done.stderr) == (1, True)


def test_a_level_is_written(tmp_path) -> None:
    out = tmp_path / "gap.blv"
    assert run("besiege", "level", "support-2", "--out", out).exit_code == 0
    assert out.read_bytes().count(b'Prefab="7000"') == 2
    done = run("besiege", "level", "lift-1", "--out", out)
    assert "has no terrain" in done.stderr
    assert ".blv" in run("besiege", "level", "lift-1", "--out", tmp_path / "x.bsg").stderr


@pytest.fixture
def played(machine, tmp_path) -> Path:
    """The log of the machine's exported file, played in a Lua."""
    file = tmp_path / "m.bsg"
    run("machine", "export", machine, "--out", file, "--task", "transport-1")
    parsed = parse_file(file.read_bytes())
    script = next(one.text for one in parsed.entries if one.key == "lua_data")
    references: dict[object, int] = {0: 0}
    for number, block in enumerate(parsed.blocks):
        key = next(one.text for one in block.entries if one.key == "bmt-lua_ref_key")
        references.setdefault(key, number)
    duration_s = builtin_tasks()["transport-1"].scenario.duration_s
    game = LuaGame(references, path=lambda i, n: (float(i), 1.0, n * 0.004))
    game.play(script, round(duration_s * 100) + 30)
    assert game.held("UpArrow") == [[100, 2100]]
    log = tmp_path / "log.txt"
    log.write_text("\ufeff" + "\r\n".join(reversed(game.lines)), encoding="utf-8")
    return log


def test_our_logs_are_scored(machine, played) -> None:
    for file in (machine, played.parent / "m.bsg"):
        done = run("besiege", "score", played, "--machine", file, "--task", "transport-1", "--json")
        told = json.loads(done.stdout)
        assert told["indicator"] == pytest.approx(12.0, abs=0.03)
        assert told["engine"] == "besiege"
    words = ("score", played, "--machine", machine, "--task", "transport-1")
    assert "distance" in run("besiege", *words).stdout


def test_logs_that_cannot_be_scored_are_named(machine, played, tmp_path) -> None:
    def said(text: str, *words: str) -> str:
        log = tmp_path / "other.txt"
        log.write_text(text, encoding="utf-8")
        done = run("besiege", "score", log, "--machine", machine, "--task", "transport-1", *words)
        assert done.exit_code == 1
        return done.stderr

    whole = played.read_text(encoding="utf-8")
    (run_id,) = run_ids(whole)
    assert "neither a log of ours nor" in said("hello")
    assert "no run 'x'; there are " + run_id in said(whole, "--run", "x")
    endless = [line for line in whole.splitlines() if ",e," not in line]
    assert "The end line is missing" in said("\n".join(endless))
    done = run("besiege", "score", played, "--machine", machine, "--task", "lift-1")
    assert "another machine or another scenario" in done.stderr
