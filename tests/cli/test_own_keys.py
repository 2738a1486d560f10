"""Machines of the game's files are tried with their own keys, whichever the game has."""

import json
from pathlib import Path

import pytest
from support.clients.commands import run

from buildarena_besiege import (
    MachineNotPlayableError,
    lines_of_keys,
    read_any_machine,
    with_own_keys,
)
from buildarena_geometry.keys import KEYS

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


@pytest.fixture
def task(tmp_path) -> Path:
    file = tmp_path / "orbit.yaml"
    file.write_text(SHORT_ORBIT)
    return file


def tried(task: Path, machine: Path, *presses: dict[str, object]) -> tuple[int, str, str]:
    keys = task.with_name("keys.json")
    keys.write_text(json.dumps(presses))
    command = ("machine", "simulate", str(machine), "--task", str(task), "--keys", str(keys))
    done = run(*command, "--json")
    return done.returncode, done.stdout, done.stderr


def height_with(task: Path, machine: Path, key: str) -> tuple[float, str]:
    code, out, err = tried(task, machine, {"time": 0, "key": key, "hold_for": 2})
    assert code == 0, err
    return json.loads(out)["metrics"]["greatest_height"], err


def test_a_contestant_sees_which_way_each_key_pushes(task) -> None:
    for machine in (THREE, FIVE):
        height, seen = height_with(task, machine, "M3")
        assert height > 60
        assert "M3: 2 thrust_left (pushes it <Up>)" in seen
        assert ("(simulated as 3)" in seen) == (machine == FIVE)
    height, seen = height_with(task, THREE, "M4")
    assert height < 1  # the exhaust points the wrong way
    assert "M4: 2 thrust_right (pushes it <Down>), 3 thrust_right (pushes it <Down>)" in seen


def test_what_the_file_sets_otherwise_is_told() -> None:
    lines = " ".join(read_any_machine(FIVE.read_bytes(), where="five").not_understood)
    assert "bmt-fthrust 1 (simulated as 3)" in lines
    assert "bmt-fthrust 3" not in lines


def test_a_key_that_no_block_has_is_refused_with_those_that_there_are(task) -> None:
    code, _, err = tried(task, THREE, {"time": 0, "key": "Z", "hold_for": 2})
    assert code == 1
    assert "expected one of E, M3, Q, M4, UpArrow" in err
    done = run("machine", "simulate", str(THREE), "--task", str(task), "--keys", "none.json")
    assert done.returncode == 2
    assert "none.json: No such file" in done.stderr


def test_own_keys_take_none_that_is_used_already() -> None:
    text = THREE.read_text().replace("<String>M3<", "<String>UpArrow<")
    imported = read_any_machine(text.encode(), where="three")
    machine, keys = with_own_keys(imported)
    assert keys["UpArrow"] == "UpArrow"
    assert len(set(keys.values())) == len(keys) == 4
    assert machine.blocks["2"].bindings["thrust_left"] == ("UpArrow", keys["E"])
    assert lines_of_keys(imported)[0].startswith("E: 2 thrust_left")


def test_more_keys_than_there_are_are_refused() -> None:
    names = [f"F{k}" for k in range(1, 16)] + list("ABCDEFGHIJK")
    keys = "".join(f"<String>{name}</String>" for name in names)
    text = THREE.read_text().replace("<String>M4</String>", keys)
    imported = read_any_machine(text.encode(), where="three")
    with pytest.raises(MachineNotPlayableError, match=f"{len(KEYS)} are free"):
        with_own_keys(imported)
