"""The workbench of an external agent: the machines it builds, by name, and their assembly."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from buildarena_geometry import Machine, Refused, ToolDefinition, tool_definitions
from buildarena_store import ExternalCall, clean

MAIN = "main"
ASSEMBLY = "assembly"
GROUPS = ("build", "refine", "assemble", "control", "query")


class Workbench:
    """Machines that are made by calls; the same calls make the same machines.

    The machine called ``assembly`` is put together from copies of all others, as they are when
    the first call to it is made.
    """

    def __init__(self) -> None:
        self.machines: dict[str, Machine] = {}

    def call(self, machine: str, tool: str, arguments: Any) -> ExternalCall:
        """Carries out an action and returns its result; no argument makes it raise."""
        tool, arguments = clean(tool), clean(arguments)
        outcome = self._machine(machine).act(tool, arguments)
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

    def _machine(self, name: str) -> Machine:
        if name not in self.machines:
            available = dict(self.machines) if name == ASSEMBLY else {}
            self.machines[name] = Machine(available=available) if available else Machine()
        return self.machines[name]


def rebuild(calls: Sequence[ExternalCall]) -> Workbench:
    """The workbench after these calls."""
    bench = Workbench()
    for call in calls:
        bench.call(call.machine, call.tool, call.arguments)
    return bench


def agent_tools() -> tuple[ToolDefinition, ...]:
    """The tools of external agents: all actions of the geometry library."""
    return tool_definitions(GROUPS)
