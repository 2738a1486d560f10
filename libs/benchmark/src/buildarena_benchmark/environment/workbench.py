"""Workbench of a builder that works alone: its machines, by name, and their assembly."""

import re
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any, Final, Self

from buildarena_benchmark import Task
from buildarena_benchmark.environment.edit_limit import limit_edits
from buildarena_benchmark.environment.errors import CallError, NothingToSubmitError
from buildarena_benchmark.environment.tools import (
    ASSEMBLY,
    LOOKUPS,
    SET_CONTROLLER,
    TEST_CONTROLLER,
    refuse_malformed,
)
from buildarena_geometry import Accepted, Catalogue, Cause, Machine, Outcome, Refused
from buildarena_geometry.documents.log import LoggedState
from buildarena_geometry.modules.names import CaselessNames
from buildarena_simulation import ControllerFailed, MachineNotSimulable
from buildarena_simulation.controllers.program import Program
from buildarena_simulation.rehearsal import MAX_TICKS, Answered, rehearsed

_READ_S: Final = 0.02
"""Processor time for which a program may keep others waiting while it is read."""
_TOOLS: Final = CaselessNames([SET_CONTROLLER, TEST_CONTROLLER.name])
_MOST_SHOWN: Final = 40
_LARGEST: Final = 1e9
_TICKS: Final = "ticks"
_FORM: Final = f"{_TICKS} is a list of at most {MAX_TICKS} objects of names and numbers"


def refused_program(task: Task | None, tool: str, arguments: Any) -> Refused | None:
    """Return why a program cannot act here: the task takes none, or it cannot be read."""
    if task is not None and not task.takes_programs:
        return Refused(
            cause=Cause.UNKNOWN_ACTION,
            text=f"There is no action {tool} in this task, which takes keys alone.",
        )
    text = arguments.get("program") if isinstance(arguments, Mapping) else None
    if tool != SET_CONTROLLER or not isinstance(text, str) or not text:
        return None
    try:
        Program(text, most_s=_READ_S)
    except ControllerFailed as failure:
        return Refused(cause=Cause.MALFORMED_ARGUMENTS, text=f"Not set: {failure.reason}.")
    return None


def answer_call(task: Task | None, machine: Machine, arguments: Any) -> Outcome:
    """Answer a call of `TEST_CONTROLLER` with the machine's program.

    Args:
        arguments: Arguments of the call; any value is answered.
    """
    if refusal := refuse_malformed(TEST_CONTROLLER, arguments):
        return refusal
    try:
        ticks = _ticks(arguments or {})
    except CallError as error:
        return Refused(cause=Cause.MALFORMED_ARGUMENTS, text=f"{error}: {_FORM}.")
    if task is None or not machine.controller:
        return Refused(
            cause=Cause.OUT_OF_RANGE, text=f"There is no program yet: {SET_CONTROLLER} sets one."
        )
    try:
        answers = rehearsed(machine.controller, machine, task.scenario, ticks)
    except (ControllerFailed, MachineNotSimulable) as failure:
        return Refused(cause=Cause.OUT_OF_RANGE, text=f"No answer: {failure.reason}.")
    return Accepted(changed=(), render=lambda: "\n".join(_describe(answer) for answer in answers))


def _ticks(arguments: Mapping[str, Any]) -> list[dict[str, float]]:
    """Return the ticks of a call.

    Raises:
        CallError: They are none.
    """
    ticks = arguments.get(_TICKS, [{}])
    if not 0 < len(ticks) <= MAX_TICKS:
        raise CallError(f"These are no {_TICKS}")
    for number, tick in enumerate(ticks):
        if not isinstance(tick, Mapping):
            raise CallError(f"{_TICKS}[{number}] is no object")
        for name, value in tick.items():
            if not _is_number(value):
                raise CallError(f"{_TICKS}[{number}].{str(name)[:60]} is no number")
    return [{str(name): float(value) for name, value in tick.items()} for tick in ticks]


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < _LARGEST


def _describe(answer: Answered) -> str:
    sensed = ", ".join(f"{name} {value:g}" for name, value in _first(answer.senses))
    done = ", ".join(f"{name} {level:.3g}" for name, level in _first(answer.actions) if level)
    return f"t {answer.time_s:g} s: it senses {sensed or 'nothing'} and does {done or 'nothing'}."


def _first(named: Mapping[str, float]) -> list[tuple[str, float]]:
    return list(named.items())[:_MOST_SHOWN]


NAME: Final = re.compile(r"[A-Za-z0-9_-]{1,40}")
"""Valid names of machines."""
_LOOKUPS: Final = CaselessNames(LOOKUPS)


class Workbench:
    """Machines that are made by calls; the same calls make the same machines.

    The machine called ``assembly`` is put together from copies of all others, as they are when
    the first call to it is made.

    Args:
        catalogue: Modules of the machines; the basic ones if left out.
        on_demand: Whether modules may be looked up here; refused where the briefing lists them.
        task: Its initial machine, if any, begins every new one.
    """

    def __init__(
        self,
        catalogue: Catalogue | None = None,
        *,
        on_demand: bool = False,
        task: Task | None = None,
    ) -> None:
        self._catalogue = catalogue
        self._task = task
        self._looked_up = on_demand
        self._machines: dict[str, Machine] = {}

    @property
    def machines(self) -> Mapping[str, Machine]:
        """Machines by name, in the order of the first calls."""
        return MappingProxyType(self._machines)

    def act(self, machine: str, tool: object, arguments: Any) -> Outcome:
        """Carry out an action on a machine; no argument makes it raise."""
        if machine not in self._machines and NAME.fullmatch(machine) is None:
            return Refused(
                cause=Cause.MALFORMED_ARGUMENTS,
                text="A machine's name has 1 to 40 letters, digits, dashes and underscores.",
            )
        if not self._looked_up and isinstance(tool, str) and _LOOKUPS.find(tool) is not None:
            return Refused(
                cause=Cause.UNKNOWN_ACTION,
                text=f"There is no action {tool} in this task, which tells its modules.",
            )
        on_program = _TOOLS.find(tool) if isinstance(tool, str) else None
        if on_program is not None:
            refusal = refused_program(self._task, on_program, arguments)
            if refusal is not None:
                return refusal
        built = self.machine(machine)
        if on_program == TEST_CONTROLLER.name:
            return answer_call(self._task, built, arguments)
        act = built.act if self._task is None else limit_edits(self._task, built)
        return act(tool, arguments)

    def machine(self, name: str) -> Machine:
        """Return the machine with a name; a missing one begins empty, or as the initial machine."""
        machine = self._machines.get(name)
        if machine is None:
            machine = self._machines[name] = self._new_machine(name)
        return machine

    def _new_machine(self, name: str) -> Machine:
        if name == ASSEMBLY:
            return Machine(catalogue=self._catalogue, available=self._machines)
        if self._task is None or self._catalogue is None:
            return Machine(catalogue=self._catalogue)
        return self._task.new_machine(self._catalogue)

    def result(self) -> tuple[str, Machine] | None:
        """Return the machine to simulate: the assembly if there is one, otherwise the only one."""
        if ASSEMBLY in self._machines:
            return ASSEMBLY, self._machines[ASSEMBLY]
        if len(self._machines) == 1:
            return next(iter(self._machines.items()))
        return None

    def submitted(self) -> Machine:
        """Return the machine that is to be simulated.

        Raises:
            NothingToSubmitError: No machine exists, or several; the message says what to do.
        """
        result = self.result()
        if result is None:
            raise NothingToSubmitError(_what_to_do(self._machines))
        return result[1]

    def values(self) -> dict[str, LoggedState]:
        """Return all its machines, as values by name."""
        return {name: machine.log for name, machine in self._machines.items()}

    def return_to(self, values: Mapping[str, LoggedState]) -> None:
        """Put on it what `values` gave; costs what differs where the machines are its own."""
        self._machines = {
            name: _restore_machine(self._machines.get(name), self._localize(value))
            for name, value in values.items()
        }

    def _localize(self, value: LoggedState) -> LoggedState:
        """Return a value from elsewhere reduced to what may be used here."""
        if self._catalogue is None or value.state.catalogue is self._catalogue:
            return value
        return replace(value, state=replace(value.state, catalogue=self._catalogue))

    @classmethod
    def holding(cls, machines: Mapping[str, Machine]) -> Self:
        """Return a workbench with these machines on it."""
        bench = cls()
        bench._machines = dict(machines)
        return bench


def _restore_machine(machine: Machine | None, value: LoggedState) -> Machine:
    if machine is None or machine.state.available is not value.state.available:
        return Machine.restored(value)
    machine.return_to(value)
    return machine


def _what_to_do(machines: Mapping[str, Machine]) -> str:
    """Return why there is nothing to submit, and how there would be."""
    if not machines:
        return "there is no machine to simulate: build one, beginning with the tool 'start'"
    listed = ", ".join(repr(name) for name in machines)
    return (
        f"there are {len(machines)} machines ({listed}) and no assembly: put them together in the "
        f"machine {ASSEMBLY!r}, with add_machine for each and connect_blocks between them, then "
        "submit again"
    )
