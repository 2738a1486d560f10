"""What adapters keep of the catalogue: numbers of versions, and machines that were driven."""

import importlib.util
import json
from pathlib import Path

import pytest
from support.machines.drive_machines import written

from buildarena_benchmark import broken_constraint, builtin_tasks
from buildarena_geometry import Machine
from buildarena_simulation import pilot_of

ROOT = Path(__file__).parents[2]
PILOTED = [task for task in builtin_tasks().values() if task.scenario.senses is not None]


@pytest.fixture(scope="module")
def writer():
    spec = importlib.util.spec_from_file_location("inspect_tasks", ROOT / "mk/inspect_tasks.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_versions_are_those_of_the_catalogue(writer) -> None:
    present = writer.VERSIONS.read_text()
    assert present == writer.versions_file(present), "make generate NAME=inspect"


def test_a_number_rises_by_one_for_each_change_and_never_falls(writer) -> None:
    present = json.loads(writer.versions_file("{}"))
    assert {entry["number"] for entry in present.values()} == {1}
    present["support-1"] = {"number": 4, "of": "task 000000000000, simulation 7, feedback 3"}
    del present["lift-1"]
    after = json.loads(writer.versions_file(json.dumps(present)))
    numbers = {name: after[name]["number"] for name in ("support-1", "support-2", "lift-1")}
    assert numbers == {"support-1": 5, "support-2": 1, "lift-1": 1}
    assert after["support-1"]["of"] == writer.compared("support-1")


def test_each_task_for_programs_has_a_machine_that_nothing_controls_yet(subtests) -> None:
    for task in PILOTED:
        with subtests.test(task=task):
            machine = Machine.from_document(json.loads(written())["machines"][task.name])
            assert broken_constraint(task, machine) is None
            assert (machine.controller, tuple(machine.control_sequence)) == ("", ())
            assert pilot_of(machine, task.scenario).axes
