"""Every module type goes out to the game's files and comes back."""

from xml.etree import ElementTree as ET

import pytest
from support.machines.building import attach
from tests.besiege.test_reading_files import assert_alike, contents

from buildarena_benchmark import builtin_tasks
from buildarena_besiege import (
    MachineNotPlayableError,
    plain_machine_file,
    prepare_run,
    read_machine_file,
)
from buildarena_geometry import Machine, module_set
from buildarena_geometry.modules.module import Module
from buildarena_simulation import Scenario

ALL = module_set("all")
BLOCKS = list(ALL.attachable)
CONNECTORS = list(ALL.connectors)
CARGO = builtin_tasks()["support-1"].scenario


def built_with(module: Module) -> Machine:
    """A machine with one module of a type, its keys bound, and another on it where one can sit."""
    machine = Machine(catalogue=ALL)
    assert machine.act("start").ok
    if module.kind == "connector":
        assert attach(machine, "1", "E").ok
        ends = {"block_a": "1", "face_a": "A", "block_b": "2", "face_b": "A"}
        outcome = machine.act("connect_blocks", {**ends, "connector": module.name})
    else:
        outcome = attach(machine, "1", "E", module.name)
    assert outcome.ok, outcome.text
    number = next(reversed([*machine.blocks, *machine.connectors]))
    for key, action in enumerate(module.actions, 1):
        bound = {"block_id": number, "action": action, "new_key": f"Alpha{key}"}
        if number in machine.blocks:
            outcome = machine.act("change_control_key", bound)
            assert outcome.ok, outcome.text
    return machine


@pytest.mark.parametrize("name", [*BLOCKS, *CONNECTORS])
def test_every_type_comes_back_as_it_was(name) -> None:
    machine = built_with(ALL[name])
    imported = read_machine_file(plain_machine_file(machine, name="m"))
    assert imported.not_understood == ()
    assert_alike(contents(imported.machine), contents(machine))
    assert Machine.from_document(imported.machine.to_document()) == imported.machine


@pytest.mark.parametrize("name", BLOCKS)
def test_the_keys_of_every_action_stand_in_the_file(name) -> None:
    module = ALL[name]
    file = ET.fromstring(plain_machine_file(built_with(module), name="m"))
    block = next(one for one in file.iter("Block") if one.get("id") == str(module.besiege_id))
    lists = {
        entry.get("key"): [one.text for one in entry.iter("String")]
        for entry in block.iter("StringArray")
    }
    keys = [[f"Alpha{k}"] for k in range(1, len(module.actions) + 1)]
    assert list(lists.values()) == keys
    assert len(lists) == len(module.actions)


def test_a_ballast_of_the_machine_is_told_from_the_cargo() -> None:
    machine = built_with(ALL["Ballast"])
    run = prepare_run(machine, CARGO, name="m", run_id="r")
    imported = read_machine_file(run.machine_file)
    assert [("cargo" in one) for one in imported.not_understood] == [True]
    assert_alike(contents(imported.machine), contents(machine))


def test_in_files_of_others_the_ballast_that_sits_on_nothing_is_cargo() -> None:
    file = ET.fromstring(plain_machine_file(built_with(ALL["Ballast"]), name="m"))
    for script in [one for one in file.iter("StringArray") if one.get("key") == "lua_data"]:
        script.text = ""
    attached = read_machine_file(ET.tostring(file))
    assert [block.module.name for block in attached.machine.blocks.values()] == [
        "Starting Block",
        "Ballast",
    ]
    ballast = next(one for one in file.iter("Block") if one.get("id") == "35")
    ballast.find("Transform/Position").set("y", "9")
    loose = read_machine_file(ET.tostring(file))
    assert [block.module.name for block in loose.machine.blocks.values()] == ["Starting Block"]
    assert any("a cargo is the task's" in one for one in loose.not_understood)


@pytest.mark.parametrize("task", ["flight-2", "mechanisms-3", "mechanisms-4"])
def test_trials_that_a_machine_file_cannot_say_are_refused(task) -> None:
    scenario = builtin_tasks()[task].scenario
    with pytest.raises(MachineNotPlayableError, match="use another engine"):
        prepare_run(built_with(ALL["Log"]), scenario, name="m", run_id="r")


def test_a_level_with_a_quarter_pipe_is_written_and_one_that_is_turned_is_refused() -> None:
    pipe = {"shape": "pipe", "center": [0, 6, 5], "radius": 5, "length": 6, "from_deg": 0}
    for heading_deg in (0, 30):
        terrain = [{**pipe, "to_deg": 90, "heading_deg": heading_deg}]
        scenario = Scenario.model_validate({"duration_s": 2, "terrain": terrain})
        if heading_deg:
            with pytest.raises(MachineNotPlayableError, match="no turned boxes"):
                prepare_run(built_with(ALL["Log"]), scenario, name="m", run_id="r")
        else:
            run = prepare_run(built_with(ALL["Log"]), scenario, name="m", run_id="r")
            assert run.level is not None
            assert run.level.count(b"<Object ID") == 12


def test_a_trial_with_a_boulder_is_refused_and_its_plain_file_is_not() -> None:
    machine, scenario = built_with(ALL["Boulder"]), builtin_tasks()["throw-1"].scenario
    with pytest.raises(MachineNotPlayableError, match="what a boulder touches: use another"):
        prepare_run(machine, scenario, name="m", run_id="r")
    assert b'id="36"' in plain_machine_file(machine, name="m")


@pytest.mark.parametrize("task", ["mechanisms-1", "mechanisms-2", "flight-1"])
def test_the_other_trials_of_the_workshop_are_written(task) -> None:
    run = prepare_run(built_with(ALL["Log"]), builtin_tasks()[task].scenario, name="m", run_id="r")
    assert b"<Machine" in run.machine_file
