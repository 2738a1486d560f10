"""The workbench of an external agent: the machines it builds, by name, and their assembly."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from buildarena_benchmark import ValidationIssue
from buildarena_geometry import Machine, Refused, ToolDefinition, tool_definitions
from buildarena_geometry.json_values import levels
from buildarena_pipeline.errors import SubmissionError
from buildarena_store import ExternalCall, clean

MAIN = "main"
ASSEMBLY = "assembly"
MAX_DEPTH = 20
MAX_BYTES = 64 << 10
"""What the arguments of one call may have as JSON; real ones have some hundred bytes."""
GROUPS = ("build", "refine", "assemble", "control", "query")


class Workbench:
    """Machines that are made by calls; the same calls make the same machines.

    The machine called ``assembly`` is put together from copies of all others, as they are when
    the first call to it is made.

    Attributes:
        machines: What was built, by name.
        size: Bytes of all arguments and feedback so far.
    """

    def __init__(self) -> None:
        self.machines: dict[str, Machine] = {}
        self.size = 0

    def call(self, machine: str, tool: str, arguments: Any) -> ExternalCall:
        """Carries out an action and returns its result; no argument makes it raise."""
        tool, arguments = clean(tool), clean(arguments)
        outcome = self.machine(machine).act(tool, arguments)
        self.size += _size(tool) + _size(arguments) + len(outcome.text.encode())
        return ExternalCall(
            machine=machine,
            tool=tool,
            arguments=arguments,
            ok=outcome.ok,
            reason=outcome.reason.value if isinstance(outcome, Refused) else None,
            feedback=outcome.text,
        )

    def result(self) -> tuple[str, Machine] | None:
        """What is to be simulated: the assembly if there is one, otherwise the only machine."""
        if ASSEMBLY in self.machines:
            return ASSEMBLY, self.machines[ASSEMBLY]
        if len(self.machines) == 1:
            return next(iter(self.machines.items()))
        return None

    def machine(self, name: str) -> Machine:
        """The machine with a name, empty when there was none."""
        if name not in self.machines:
            available = dict(self.machines) if name == ASSEMBLY else {}
            self.machines[name] = Machine(available=available) if available else Machine()
        return self.machines[name]


def check_arguments(arguments: Any) -> None:
    """Checks that a call's arguments are bounded.

    Raises:
        SubmissionError: They are too deep or too large.
    """
    for depth, level in enumerate(levels(arguments)):
        if depth >= MAX_DEPTH and any(isinstance(value, dict | list) for value in level):
            raise _refused(f"more than {MAX_DEPTH} lists or objects inside each other")
    size = _size(arguments)
    if size > MAX_BYTES:
        raise _refused(f"{size:,} bytes; a call's arguments have at most {MAX_BYTES:,}")


def _size(value: Any) -> int:
    """Bytes of a JSON value."""
    return len(json.dumps(value, separators=(",", ":")))


def _refused(message: str) -> SubmissionError:
    return SubmissionError([ValidationIssue(path="arguments", message=message)])


def rebuild(calls: Sequence[ExternalCall]) -> Workbench:
    """The workbench after these calls."""
    bench = Workbench()
    for call in calls:
        bench.call(call.machine, call.tool, call.arguments)
    return bench


def agent_tools() -> tuple[ToolDefinition, ...]:
    """The tools of external agents: all actions of the geometry library."""
    return tool_definitions(GROUPS)
