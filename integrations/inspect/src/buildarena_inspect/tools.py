"""The tools of one sample, with their usual names, descriptions and schemas."""

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
    """Return all actions of the task, for this building."""
    return [_action(tool, building) for tool in building.environment.tools if tool is not SUBMIT]


def submit_tool(building: Building) -> ToolDef:
    """Return the tool that submits the machine.

    The model reads an error if there is nothing to submit; Inspect's agents continue after it.
    """

    async def execute() -> str:
        try:
            return (await building.submit()).report
        except (NothingToSubmitError, EpisodeOverError) as error:
            raise ToolError(str(error)) from error

    return _tool(SUBMIT, execute)


def put_numbers_into_texts(call: ToolCall, tools: Iterable[ToolDefinition]) -> None:
    """Convert integers in a call to texts where the tool requires texts.

    Inspect checks schemas strictly; elsewhere a block's id may be a number.
    """
    for tool in tools:
        if tool.name == call.function:
            for name, schema in tool.parameters["properties"].items():
                if schema.get("type") == "string" and type(call.arguments.get(name)) is int:
                    call.arguments[name] = str(call.arguments[name])


def parameters_of(schema: Mapping[str, Any]) -> ToolParams:
    """Convert a tool's schema for Inspect, which requires a description of every parameter."""
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
        max_output=0,  # other interfaces do not cut feedback either
    )
