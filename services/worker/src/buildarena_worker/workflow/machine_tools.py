"""The geometry library's actions as tools of a role."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

from buildarena_geometry import Machine, Refused, load_catalogue, tool_definitions
from buildarena_geometry.feedback.modules import modules_in_short as catalogue_in_short
from buildarena_geometry.feedback.modules import modules_text as catalogue_text
from buildarena_pipeline.transcript import ActionResult
from buildarena_worker.session.dialogue import Act
from buildarena_worker.session.messages import Tool, ToolCall

QUERIES = ("get_machine_summary", "get_block_details")
BUILD = (
    "start",
    "attach_block_to",
    "connect_blocks",
    "remove_block",
    "reset",
    "twist_block",
    "shift_block",
    "flip_spin",
    *QUERIES,
)
REFINE = ("twist_block", "shift_block", "flip_spin", *QUERIES)
ASSEMBLE = (
    "add_machine",
    "shift_machine",
    "rotate_machine",
    "remove_machine",
    "connect_blocks",
    "attach_block_to",
    "remove_block",
    "twist_block",
    "shift_block",
    "flip_spin",
    *QUERIES,
)


def tools_named(names: Sequence[str]) -> list[Tool]:
    """The library's tool definitions with these names, in this order."""
    known = {tool.name: tool for tool in tool_definitions()}
    return [
        Tool(
            name=name,
            description=known[name].description,
            parameters=_in_short(known[name].parameters),
        )
        for name in names
    ]


_TOLD: Final = frozenset({"init_rotation", "rotation", "machine_id", "machine_index"})
"""Arguments whose descriptions say more than their names and the tools' own words."""


def _in_short(schema: Mapping[str, Any]) -> dict[str, Any]:
    """A schema without what names, prompts and refusals say as well."""
    properties = {
        name: {
            key: value
            for key, value in told.items()
            if key != "maxLength" and (key != "description" or name in _TOLD)
        }
        for name, told in schema["properties"].items()
    }
    return {"type": "object", "properties": properties, "required": schema["required"]}


def acting_on(machine: Machine) -> Act:
    """Carries out tool calls on a machine."""

    def act(call: ToolCall) -> ActionResult:
        outcome = machine.act(call.name, call.arguments)
        return ActionResult(
            name=call.name,
            arguments=call.arguments,
            ok=outcome.ok,
            reason=outcome.reason.value if isinstance(outcome, Refused) else None,
            feedback=outcome.text,
        )

    return act


def modules_text(names: Sequence[str] | None = None) -> str:
    """The module list for people and models, generated from the catalogue.

    Args:
        names: Only these modules, and the starting block; all that can be built by default.
    """
    return catalogue_text(load_catalogue(), names)


def parts_text(names: Sequence[str] | None = None) -> str:
    """The module list in short: sizes, masses and actions, without descriptions.

    Args:
        names: Only these modules and the start; all that can be built by default.
    """
    return catalogue_in_short(load_catalogue(), names)


def connectors_of(names: Sequence[str] | None = None) -> list[str]:
    """Names of the connectors among some modules, or of all."""
    return [
        module.name
        for module in load_catalogue().values()
        if module.size is None and (names is None or module.name in names)
    ]


def tools_text(names: Sequence[str]) -> str:
    """Tools and their limits for somebody who does not hold them, one line each."""
    return "\n".join(f"- {tool.name}: {tool.description}" for tool in tools_named(names))
