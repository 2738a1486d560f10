"""The workbench of an external agent: like any other, and each call is stored."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from buildarena_backend.database.text import clean
from buildarena_backend.errors import SubmissionError
from buildarena_backend.journal.external_calls import ExternalCall
from buildarena_benchmark import Task, ValidationIssue
from buildarena_benchmark.environment import workbench as building
from buildarena_benchmark.environment.briefing import visible_catalogue
from buildarena_geometry import Accepted, Catalogue, Machine, Refused
from buildarena_geometry.json_texts import write_json

TEST: Final = "test_trial"
"""Tool name that marks a test trial among a session's calls."""
TESTED: Final = "The machine is tried as it stands; the session tells what was measured."
MAX_DEPTH = 20
MAX_BYTES = 64 << 10
"""Size of one call's arguments as JSON; real ones have some hundred bytes."""


class Workbench(building.Workbench):
    """A workbench whose calls are stored, with texts that a database accepts.

    Attributes:
        size: Bytes of all arguments and feedback so far.
        tests: Test trials so far.
        max_test_trials: Test trials that the task has.
    """

    def __init__(
        self,
        catalogue: Catalogue | None = None,
        *,
        on_demand: bool = False,
        task: Task | None = None,
    ) -> None:
        super().__init__(catalogue, on_demand=on_demand, task=task)
        self.size = 0
        self.tests = 0
        self.max_test_trials = 0 if task is None else task.test_trials

    def call(self, machine: str, tool: str, arguments: Any) -> ExternalCall:
        """Carry out an action and return its result; no argument makes it raise.

        `TEST` names no action: it marks a trial of the machine in its state at that point.
        """
        tool, arguments = clean(tool), clean(arguments)
        is_test = tool == TEST and self.tests < self.max_test_trials
        self.tests += is_test
        tested = Accepted(changed=(), render=lambda: TESTED)
        outcome = tested if is_test else self.act(machine, tool, arguments)
        self.size += len(write_json([tool, arguments])) + len(outcome.text.encode())
        return ExternalCall(
            machine=machine,
            tool=tool,
            arguments=arguments,
            ok=outcome.ok,
            reason=outcome.reason.value if isinstance(outcome, Refused) else None,
            feedback=outcome.text,
        )


def check_arguments(arguments: Any) -> None:
    """Check that a call's arguments are bounded.

    Raises:
        SubmissionError: They are not JSON, too deep or too large.
    """
    try:
        size = len(write_json(arguments, MAX_DEPTH))
    except ValueError as error:
        raise _refusal(str(error)) from error
    if size > MAX_BYTES:
        raise _refusal(f"{size:,} bytes; a call's arguments have at most {MAX_BYTES:,}")


def _refusal(message: str) -> SubmissionError:
    return SubmissionError([ValidationIssue(path="arguments", message=message)])


def bench_of(task: Task | None, *, data_sheets: bool) -> Workbench:
    """Return an empty workbench with a task's modules and rules.

    Args:
        task: None if it was removed.
        data_sheets: Whether modules that are looked up come with their numbers.
    """
    if task is None:
        return Workbench()
    return Workbench(
        visible_catalogue(task.constraints, data_sheets=data_sheets),
        on_demand=task.constraints.on_demand,
        task=task,
    )


def repeat_calls(
    calls: Sequence[ExternalCall], bench: Workbench
) -> tuple[list[ExternalCall], list[Machine]]:
    """Make calls again.

    Args:
        bench: An empty workbench.

    Returns:
        The calls with their present results, and the machines of the test trials.
    """
    results, machines = list[ExternalCall](), list[Machine]()
    for call in calls:
        results.append(bench.call(call.machine, call.tool, call.arguments))
        if len(machines) < bench.tests:
            machines.append(bench.submitted().copy())
    return results, machines


def rebuild(calls: Sequence[ExternalCall], task: Task | None, *, data_sheets: bool) -> Workbench:
    """Return the workbench after these calls in a session of a task; arguments of `bench_of`."""
    bench = bench_of(task, data_sheets=data_sheets)
    for call in calls:
        bench.call(call.machine, call.tool, call.arguments)
    return bench
