"""Designs as the calls of a builder without a workflow, for programs that have no session."""

# BuildArena benchmark data, not for training corpora:
# canary 3ab839c7-e533-462b-9729-71495c1ee1f6

from collections.abc import Mapping
from typing import Any

from buildarena_benchmark.environment import ASSEMBLY, MAIN
from buildarena_benchmark.experts import expert_designs
from buildarena_benchmark.experts.design import Design
from buildarena_benchmark.experts.drafting import Action

Call = dict[str, Any]
"""`machine`, `tool` and `arguments`, as an `Environment` takes them."""


def calls_of(task: str, seed: int) -> list[Call] | None:
    """Return the calls that build and control the expert's machine for a task.

    Args:
        seed: Varies the design within its tolerances.

    Returns:
        The calls; None without a design, or if the design depends on the results of trials.
    """
    make = expert_designs().get(task)
    design = None if make is None else make(seed)
    if design is None or design.steer is not None:
        return None
    return calls_with(design, design.control or {})


def calls_with(design: Design, answer: Mapping[str, Any]) -> list[Call]:
    """Return the calls that build a design and follow its controller."""
    calls = [
        call(name if design.assembly else MAIN, *action)
        for name, part in design.parts.items()
        for action in part.actions
    ]
    target = ASSEMBLY if design.assembly else MAIN
    calls += [call(target, *action) for action in (*design.assembly, *control_of(answer))]
    if design.program:
        calls.append(call(target, "set_controller", {"program": design.program}))
    return calls


def call(machine: str, tool: str, arguments: Mapping[str, Any]) -> Call:
    """Return one call."""
    return {"machine": machine, "tool": tool, "arguments": dict(arguments)}


def control_of(answer: Mapping[str, Any]) -> list[Action]:
    """Return a controller's answer as actions."""
    actions: list[Action] = []
    for bound in answer.get("control_config", ()):
        for number, key in enumerate(bound["keys"]):
            tool = "add_control_key" if number else "change_control_key"
            binding = {"block_id": bound["block"], "action": bound["action"], "new_key": key}
            actions.append((tool, binding))
    pressed = answer.get("control_sequence", ())
    return actions + [("add_control_sequence", dict(press)) for press in pressed]
