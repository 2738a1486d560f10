"""Programs on a workbench: read before a machine takes them, and asked without a trial."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from buildarena_benchmark import Task
from buildarena_benchmark.environment.errors import CallError
from buildarena_benchmark.environment.tools import SET_CONTROLLER, TEST_CONTROLLER
from buildarena_geometry import Accepted, Cause, Machine, Outcome, Refused
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


def program_tool(tool: object) -> str | None:
    """The name of the tool on programs that is meant; None for any other."""
    return _TOOLS.find(tool) if isinstance(tool, str) else None


def refused_program(task: Task | None, tool: str, arguments: Any) -> Refused | None:
    """Why a program cannot act here: the task takes none, or it cannot be read."""
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


def asked(task: Task | None, machine: Machine, arguments: Any) -> Outcome:
    """What a machine's program answers to a call of `TEST_CONTROLLER`.

    Args:
        task: What is built for, which says what can be sensed.
        machine: The machine with the program.
        arguments: The call's; whatever they are, it is answered.
    """
    try:
        ticks = _ticks(arguments)
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
    return Accepted(changed=(), render=lambda: "\n".join(_told(answer) for answer in answers))


def _ticks(arguments: Any) -> list[dict[str, float]]:
    """The ticks of a call.

    Raises:
        CallError: They are none.
    """
    arguments = {} if arguments is None else arguments
    if not isinstance(arguments, Mapping):
        raise CallError(f"{TEST_CONTROLLER.name} takes an object of arguments")
    further = [name for name in arguments if name != _TICKS]
    if further:
        raise CallError(f"There is no argument {str(further[0])[:60]!r}")
    ticks = arguments.get(_TICKS, [{}])
    if not isinstance(ticks, list | tuple) or not 0 < len(ticks) <= MAX_TICKS:
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


def _told(answer: Answered) -> str:
    sensed = ", ".join(f"{name} {value:g}" for name, value in _first(answer.senses))
    done = ", ".join(f"{name} {level:.3g}" for name, level in _first(answer.actions) if level)
    return f"t {answer.time_s:g} s: it senses {sensed or 'nothing'} and does {done or 'nothing'}."


def _first(named: Mapping[str, float]) -> list[tuple[str, float]]:
    return list(named.items())[:_MOST_SHOWN]
