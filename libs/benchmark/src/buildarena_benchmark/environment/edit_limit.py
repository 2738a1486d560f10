"""Building on a machine that a task gives: changes beyond its edits are refused."""

from collections.abc import Callable
from typing import Any

from buildarena_benchmark import Task
from buildarena_benchmark.constraints import edit_limit_violation
from buildarena_geometry import Cause, Machine, Outcome, Refused


def limit_edits(task: Task, machine: Machine) -> Callable[[object, Any], Outcome]:
    """Return the machine's `act`, as a task's builder has it.

    Where the task gives a machine, an action after which it differs by too many edits is refused,
    and leaves everything as it was.
    """
    if task.initial_machine is None:
        return machine.act

    def act(name: object, arguments: Any = None) -> Outcome:
        before = machine.log
        outcome = machine.act(name, arguments)
        too_much = edit_limit_violation(task, machine)
        if too_much is None:
            return outcome
        machine.return_to(before)
        return Refused(cause=Cause.OUT_OF_RANGE, text=f"Refused: {too_much}. Undo an edit first.")

    return act
