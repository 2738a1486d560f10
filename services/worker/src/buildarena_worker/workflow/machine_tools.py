"""The geometry library's actions as tools of a role."""

from __future__ import annotations

from collections.abc import Sequence

from buildarena_geometry import Machine, Refused, load_catalogue, tool_definitions
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
GROUPS = ("build", "refine", "assemble", "control", "query")


def tools_named(names: Sequence[str]) -> list[Tool]:
    """The library's tool definitions with these names, in this order."""
    known = {tool.name: tool for tool in tool_definitions(GROUPS)}
    return [
        Tool(
            name=name,
            description=known[name].description,
            parameters=known[name].parameters,
        )
        for name in names
    ]


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
