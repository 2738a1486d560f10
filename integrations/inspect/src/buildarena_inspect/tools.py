"""The tools of one sample, with the names, words and schemas that they have everywhere."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from inspect_ai.tool import ToolCall, ToolDef, ToolError, ToolParams
from inspect_ai.util import JSONSchema

from buildarena_benchmark.environment import EpisodeOverError, NothingToSubmitError
from buildarena_benchmark.environment.tools import SUBMIT
from buildarena_geometry import ToolDefinition
from buildarena_inspect.building import Building


def building_tools(building: Building) -> list[ToolDef]:
    """All actions that the task has, each on this building."""
    return [_action(tool, building) for tool in building.environment.tools if tool is not SUBMIT]


def submit_tool(building: Building) -> ToolDef:
    """The tool that has the machine simulated.

    What can't be submitted is an error that the model reads; agents of Inspect go on after one.
    """

    async def execute() -> str:
        try:
            return (await building.submit()).report
        except (NothingToSubmitError, EpisodeOverError) as error:
            raise ToolError(str(error)) from error

    return _tool(SUBMIT, execute)


def put_numbers_into_texts(call: ToolCall, tools: Iterable[ToolDefinition]) -> None:
    """Makes texts of the whole numbers that a call gives where a tool takes texts.

    Inspect refuses what does not fit a schema; a block's id as a number does, everywhere else.
    """
    for tool in tools:
        if tool.name == call.function:
            for name, schema in tool.parameters["properties"].items():
                if schema.get("type") == "string" and type(call.arguments.get(name)) is int:
                    call.arguments[name] = str(call.arguments[name])


def parameters_of(schema: Mapping[str, Any]) -> ToolParams:
    """A tool's schema as Inspect has it, which requires a description of every parameter."""
    return ToolParams(
        properties={
            name: JSONSchema.model_validate({"description": name.replace("_", " "), **value})
            for name, value in schema.get("properties", {}).items()
        },
        required=list(schema.get("required", ())),
        additionalProperties=bool(schema.get("additionalProperties", False)),
    )


def _action(definition: ToolDefinition, building: Building) -> ToolDef:
    async def execute(**kwargs: Any) -> str:
        return building.call(definition.name, kwargs)

    return _tool(definition, execute)


def _tool(definition: ToolDefinition, execute: Any) -> ToolDef:
    return ToolDef(
        execute,
        name=definition.name,
        description=definition.description,
        parameters=parameters_of(definition.parameters),
        max_output=0,  # what a model reads is not cut off elsewhere
    )
