"""The actions as tools for models."""

import inspect

import jsonschema
import pytest

from buildarena_geometry import GROUPS, Machine, tool_definitions
from buildarena_geometry.tools import ACTIONS

PAPERS_ACTIONS = {
    "build": ["start", "attach_block_to", "connect_blocks", "remove_block", "reset"],
    "refine": ["twist_block", "shift_block", "flip_spin"],
    "assemble": ["add_machine", "shift_machine", "rotate_machine", "remove_machine"],
    "control": [
        "change_control_key",
        "add_control_sequence",
        "remove_control_sequence",
        "reset_control_sequence",
    ],
    "query": [
        "get_machine_summary",
        "get_block_details",
        "review_powered_blocks",
        "review_control_config",
        "review_control_sequence",
    ],
}


@pytest.mark.parametrize("group", GROUPS)
def test_every_action_of_the_paper_is_a_tool_of_its_group(group):
    names = [tool.name for tool in tool_definitions([group])]
    assert [name for name in names if name in PAPERS_ACTIONS[group]] == PAPERS_ACTIONS[group]


@pytest.mark.parametrize("tool", tool_definitions(), ids=lambda tool: tool.name)
def test_a_tool_says_what_it_does_and_what_each_argument_means(tool):
    jsonschema.Draft202012Validator.check_schema(tool.parameters)
    assert tool.description.endswith(".")
    assert "state" not in tool.parameters["properties"]
    for argument in tool.parameters["properties"].values():
        assert argument["description"].endswith(".")


@pytest.mark.parametrize("name", ACTIONS)
def test_required_arguments_are_those_without_a_default(name):
    signature = inspect.signature(ACTIONS[name].propose).parameters
    wanted = [key for key, one in signature.items() if one.default is one.empty and key != "state"]
    assert list(ACTIONS[name].definition.parameters["required"]) == wanted


def test_groups_come_in_the_order_asked_for():
    groups = [tool.group for tool in tool_definitions(["query", "build"])]
    assert groups == sorted(groups, reverse=True)


def test_an_unknown_group_is_refused_with_the_known_ones():
    with pytest.raises(ValueError, match="there is no group 'move'; the groups are build, refine"):
        tool_definitions(["move"])


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("start", {"init_shift": [0, 1.5, 0], "note": "x"}),
        ("attach_block_to", {"base_block": "1", "face": "A", "new_block": "Torch"}),
        ("twist_block", {"block_id": "2", "angle": 45}),
        ("shift_block", {"block_id": "2", "shift_real": [0.1, 0, 0]}),
        ("get_machine_summary", {}),
    ],
)
def test_arguments_the_schema_takes_are_read_and_junk_it_refuses_is_refused(name, arguments):
    (schema,) = (tool.parameters for tool in tool_definitions() if tool.name == name)
    jsonschema.validate(arguments, schema)
    machine = Machine()
    assert machine.act(name, arguments).ok or machine.log[-1].reason != "malformed_arguments"
    for spoilt in ({**arguments, "more": 1}, {**arguments, next(iter(arguments), "x"): {}}):
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate(spoilt, schema)
        machine.act(name, spoilt)
        assert machine.log[-1].reason == "malformed_arguments"
