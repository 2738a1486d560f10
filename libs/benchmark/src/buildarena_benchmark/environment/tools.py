"""Tools of models: the actions of the geometry library, and those that end the work."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

from buildarena_benchmark import Task
from buildarena_geometry import (
    GROUPS,
    LOOKUP,
    PROGRAM,
    Cause,
    Refused,
    ToolDefinition,
    modules_named,
    object_schema,
    tool_definitions,
)
from buildarena_geometry.feedback.words import listing
from buildarena_simulation.rehearsal import MAX_TICKS

MAIN: Final = "main"
"""Name of a machine where none is given."""
ASSEMBLY: Final = "assembly"
"""The machine that is put together from copies of all others."""
SUBMIT: Final = ToolDefinition(
    name="submit",
    description="Finish: the machine is simulated and scored.",
    parameters=object_schema({}),
    group="submit",
)
OBJECTION: Final = ToolDefinition(
    name="raise_objection",
    description="End as a failure: the task cannot be done within its rules.",
    parameters=object_schema({"reason": {"type": "string"}}, ["reason"]),
)
"""Tool by which a role of a workflow gives up."""
MACHINE: Final = {"type": "string"}
"""Schema of the argument that names the sub-structure of a call."""
LOOKUPS: Final = tuple(tool.name for tool in tool_definitions([LOOKUP]))
"""Names of the tools that modules are looked up with."""
(SET_CONTROLLER,) = (tool.name for tool in tool_definitions([PROGRAM]))
TEST_CONTROLLER: Final = ToolDefinition(
    name="test_controller",
    description="Run the program without a trial; reports what it senses and does.",
    parameters=object_schema(
        {
            "ticks": {
                "type": "array",
                "maxItems": MAX_TICKS,
                "items": {"type": "object", "additionalProperties": {"type": "number"}},
                "description": "One object a tick: senses that change from then on, such as "
                '{"position.z": 4.5, "marks.goal.relative.x": -2, "t": 1}. Default: the start.',
            }
        }
    ),
    group=PROGRAM,
)
"""Actions of builders in addition to the tool that sets a program."""


def building_tools(task: Task | None = None) -> tuple[ToolDefinition, ...]:
    """Return the actions of the geometry library and the test of a program.

    Args:
        task: Restricts the tools to those that apply to it; None for all.
    """
    if task is None:
        return (*tool_definitions((*GROUPS, LOOKUP, PROGRAM)), TEST_CONTROLLER)
    limits = task.constraints
    groups = {"build", "refine", "query"}
    groups |= {"assemble"} if limits.max_sub_structures > 1 else set()
    groups |= {"control"} if task.control == "agent" else set()
    groups |= {LOOKUP} if limits.on_demand else set()
    groups |= {PROGRAM} if task.takes_programs else set()
    offered = [name for name in (*GROUPS, LOOKUP, PROGRAM) if name in groups]
    excluded = set(_IN_THE_SUMMARY)
    excluded |= _NOT_WITH_A_GIVEN_MACHINE if task.initial_machine is not None else set()
    modules = [limits.catalogue[name] for name in modules_named(limits.modules)]
    if not any(module.kind == "connector" for module in modules):
        excluded.add("connect_blocks")
    if not any(module.spins for module in modules):
        excluded.add("flip_spin")
    tools = [tool for tool in tool_definitions(offered) if tool.name not in excluded]
    return (*tools, *[TEST_CONTROLLER] * task.takes_programs)


_IN_THE_SUMMARY: Final = {
    "review_powered_blocks",
    "review_control_config",
    "review_control_sequence",
    "remove_control_sequence",
}
"""Tools that a builder with the summary and resets of presses does not need; calls still work."""
_NOT_WITH_A_GIVEN_MACHINE: Final = {
    "start",
    "reset",
    "add_control_sequence",
    "reset_control_sequence",
}


def tools_of_models(task: Task | None = None) -> tuple[ToolDefinition, ...]:
    """Return the tools of a builder: the actions and the submission.

    Args:
        task: See `building_tools`. Actions have one more argument, `machine`, unless the task
            allows one sub-structure only.
    """
    tools = building_tools(task)
    if task is None or task.constraints.max_sub_structures > 1:
        tools = tuple(replace(tool, parameters=_with_machine(tool.parameters)) for tool in tools)
    return (*tools, SUBMIT)


def _with_machine(parameters: Mapping[str, Any]) -> dict[str, Any]:
    return {**parameters, "properties": {**parameters["properties"], "machine": MACHINE}}


_TYPES: Final[Mapping[str, tuple[type, ...]]] = {
    "string": (str,),
    "number": (int, float),
    "integer": (int,),
    "array": (list, tuple),
}


def refuse_malformed(tool: ToolDefinition, arguments: Any) -> Refused | None:
    """Return the refusal of arguments that do not have the form of a tool's; None if they do.

    Actions of the geometry library check theirs themselves.
    """
    values = {} if arguments is None else arguments
    properties = tool.parameters["properties"]
    takes = f"{tool.name} takes {listing(properties)}"
    if not isinstance(values, Mapping):
        text = f"{takes}, as an object."
    elif unknown := [name for name in values if name not in properties]:
        text = f"There is no argument {str(unknown[0])[:60]!r}. {takes}."
    elif missing := [name for name in tool.parameters["required"] if name not in values]:
        text = f"Missing: {listing(missing)}. {takes}."
    elif wrong := [name for name, value in values.items() if not _fits(value, properties[name])]:
        text = f"{wrong[0]} is not of the type {properties[wrong[0]]['type']}."
    else:
        return None
    return Refused(cause=Cause.MALFORMED_ARGUMENTS, text=text)


def _fits(value: object, schema: Mapping[str, Any]) -> bool:
    if isinstance(value, bool) or not isinstance(value, _TYPES[schema["type"]]):
        return False
    if isinstance(value, int | float):
        return -_LARGEST < value < _LARGEST and value >= schema.get("minimum", value)
    return not isinstance(value, str) or bool(value.strip())


_LARGEST: Final = 1e9
"""Beyond any number that a tool takes."""
