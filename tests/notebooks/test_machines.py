"""Machines in notebooks are those of the geometry library, with an action for each method."""

import inspect
import json
import subprocess
import sys

import pytest

import buildarena as ba
from buildarena_geometry import Machine, tool_definitions

HEAVY = ["numpy", "fcl", "mujoco", "pybullet", "pyarrow", "pydantic", "fastapi", "sqlalchemy"]
ROW = "Small Wooden Block"


def bridge(each_side: int = 3) -> ba.Machine:
    """A row over the gap."""
    machine = ba.Machine()
    machine.start()
    for face in "EF":
        base = "1"
        for _ in range(each_side):
            placed = machine.attach_block_to(base, face if base == "1" else "E", ROW)
            base = placed.changed[0]
    return machine


def test_each_action_is_a_method_with_its_tool_s_words(subtests):
    for tool in tool_definitions():
        with subtests.test(tool=tool):
            method = getattr(ba.Machine, tool.name)
            names = [name for name in inspect.signature(method).parameters if name != "self"]
            assert names == list(tool.parameters["properties"])
            required = [
                name
                for name, parameter in inspect.signature(method).parameters.items()
                if parameter.default is inspect.Parameter.empty and name != "self"
            ]
            assert required == tool.parameters["required"]
            assert method.__doc__.startswith(tool.description)
            for name, schema in tool.parameters["properties"].items():
                assert f"    {name}: {schema['description']}" in method.__doc__


def test_the_machine_is_the_geometry_library_s():
    built, acted = bridge(1), Machine()
    acted.act("start", {})
    acted.act("attach_block_to", {"base_block": "1", "face": "E", "new_block": ROW})
    acted.act("attach_block_to", {"base_block": "1", "face": "F", "new_block": ROW})
    assert json.dumps(built.to_document()) == json.dumps(acted.to_document())
    assert isinstance(built.copy(), ba.Machine)
    again = ba.Machine.from_document(acted.to_document())
    assert again == built
    assert again.get_machine_summary().text == acted.act("get_machine_summary", {}).text


def test_feedback_reads_as_a_model_reads_it():
    machine = ba.Machine()
    first = machine.start()
    assert first.ok
    assert repr(first) == str(first) == first.text
    assert first.text.startswith("Started. 1 Starting Block")
    twice = machine.start()
    assert not twice
    assert (twice.reason, twice.changed) == ("multiple_initialization", ())
    assert repr(twice) == f"Refused (multiple_initialization): {twice.text}"
    assert str(twice) == twice.text


def test_bad_values_are_refused_and_bad_calls_raise(subtests):
    for given in [{"base_block": 1, "face": "Z"}, {"base_block": None}, {"face": {"a": [1]}}, {}]:
        with subtests.test(given=given):
            machine = ba.Machine()
            machine.start()
            before = machine.to_document()["blocks"]
            usual = {"base_block": "1", "face": "A", "new_block": "Small Wooden Blck"}
            assert not machine.attach_block_to(**{**usual, **given})
            assert machine.to_document()["blocks"] == before
            with pytest.raises(TypeError, match="colour"):
                machine.attach_block_to(**usual, colour="red")
            with pytest.raises(TypeError, match="base_block"):
                machine.attach_block_to()


def test_unknown_names_are_answered_with_the_choices():
    with pytest.raises(AttributeError, match="no 'atach_block_to'; its actions are start, attach"):
        ba.Machine().atach_block_to("1", "A", ROW)
    assert not hasattr(ba.Machine(), "_ipython_canary_method_should_not_exist_")
    with pytest.raises(AttributeError, match="has no 'Machin'; it has Feedback, Machine"):
        _ = ba.Machin
    assert set(ba.__all__) <= set(dir(ba))
    for name in ba.__all__:
        assert getattr(ba, name) is not None


def test_assemblies_are_built_of_machines():
    assembly = ba.Machine(available={"row": bridge(1)})
    assert assembly.add_machine("row")
    assert len(assembly.blocks) == 3


def test_importing_it_loads_nothing_heavy():
    code = (
        "import sys, buildarena\n"
        f"heavy = [name for name in {HEAVY} if name in sys.modules]\n"
        "assert not heavy, heavy\n"
        "buildarena.Machine().start()\n"
        "assert 'mujoco' not in sys.modules and 'pydantic' not in sys.modules\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
