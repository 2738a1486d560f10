"""The guide says what is so, and the examples run."""

import doctest
import json
import runpy
import sys
from pathlib import Path

import pytest
from support.programs import captured

from buildarena_geometry import Machine, tool_definitions

ROOT = Path(__file__).parents[2]
GUIDE = ROOT / "docs" / "geometry.md"
EXAMPLES = ROOT / "examples" / "geometry"


def test_what_the_guide_shows_is_what_the_library_answers():
    results = doctest.testfile(str(GUIDE), module_relative=False, optionflags=doctest.FAIL_FAST)
    assert results.attempted > 15
    assert results.failed == 0


def test_the_guide_names_every_action():
    text = GUIDE.read_text()
    assert [tool.name for tool in tool_definitions() if f"`{tool.name}`" not in text] == []


def test_the_first_machine_is_saved_and_drives_north(tmp_path):
    command = [sys.executable, str(EXAMPLES / "first_machine.py"), str(tmp_path)]
    rendered = captured(command).stdout
    car = Machine.from_document(json.loads((tmp_path / "car.json").read_text()))
    assert car.part_count == 7
    summary = rendered[rendered.rindex("7 parts") :]
    assert summary.count("forward rolls it <North>") == 4
    assert (tmp_path / "car.glb").read_bytes().startswith(b"glTF")
    assert (tmp_path / "car.svg").read_text().startswith("<svg")


def test_the_gate_hangs_together():
    gate = runpy.run_path(str(EXAMPLES / "assembly.py"))["build_gate"]()
    assert gate.part_count == 13
    assert gate.detached == ()


def test_a_pole_stands_on_modules_of_its_own():
    pole = runpy.run_path(str(EXAMPLES / "own_modules.py"))["build_pole"]()
    assert pole.bounds[1, 2] == pytest.approx(6.5)
