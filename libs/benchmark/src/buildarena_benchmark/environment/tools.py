"""What models may call: the actions of the geometry library, and what ends the work."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from buildarena_geometry import (
    GROUPS,
    LOOKUP,
    PROGRAM,
    ToolDefinition,
    object_schema,
    tool_definitions,
)
from buildarena_simulation.rehearsal import MAX_TICKS

MAIN: Final = "main"
"""What a machine is called where no name is given."""
ASSEMBLY: Final = "assembly"
"""The machine that is put together from copies of all others."""
SUBMIT: Final = ToolDefinition(
    name="submit",
    description="End the building: the machine is simulated and scored.",
    parameters=object_schema({}),
    group="submit",
)
OBJECTION: Final = ToolDefinition(
    name="raise_objection",
    description="End the work as a failure because it cannot be done within the task's rules.",
    parameters=object_schema(
        {"reason": {"type": "string", "description": "Why it cannot be done."}}, ["reason"]
    ),
)
"""What a role of a workflow calls to give up."""
MACHINE: Final = {
    "type": "string",
    "description": "Sub-structure it is meant for, a new one if there is none of this name; "
    f"{ASSEMBLY!r} joins copies of all others.",
    "default": MAIN,
}
"""Schema of the argument that says which machine a call is meant for."""
LOOKUPS: Final = tuple(tool.name for tool in tool_definitions([LOOKUP]))
"""Names of the tools that modules are looked up with."""
(SET_CONTROLLER,) = (tool.name for tool in tool_definitions([PROGRAM]))
TEST_CONTROLLER: Final = ToolDefinition(
    name="test_controller",
    description="Ask the machine's program what it would do, without a trial: at the start, or "
    "with senses that you name. Nothing changes.",
    parameters=object_schema(
        {
            "ticks": {
                "type": "array",
                "maxItems": MAX_TICKS,
                "items": {"type": "object", "additionalProperties": {"type": "number"}},
                "description": "One object a tick, one tick after the other: what is different "
                'from then on, such as {"position.z": 4.5, "marks.goal.relative.x": -2, "t": 1}; '
                "t is the time in seconds. Left out: one tick at the start.",
            }
        }
    ),
    group=PROGRAM,
)
"""What builders have beside the tool that sets a program."""


def building_tools(
    *, on_demand: bool = False, programs: bool = False
) -> tuple[ToolDefinition, ...]:
    """All actions of the geometry library, as they are, and the test of a program.

    Args:
        on_demand: Whether the task has its modules looked up, and there are tools for that.
        programs: Whether it takes programs in place of keys.
    """
    further = [LOOKUP] * on_demand + [PROGRAM] * programs
    return (*tool_definitions((*GROUPS, *further)), *[TEST_CONTROLLER] * programs)


def tools_of_models(
    *, on_demand: bool = False, programs: bool = False
) -> tuple[ToolDefinition, ...]:
    """The actions with one more argument, `machine`, and the tool that submits.

    Args:
        on_demand: As for `building_tools`.
        programs: As for `building_tools`.
    """
    building = [
        replace(
            tool,
            parameters={
                **tool.parameters,
                "properties": {**tool.parameters["properties"], "machine": MACHINE},
            },
        )
        for tool in building_tools(on_demand=on_demand, programs=programs)
    ]
    return (*building, SUBMIT)
