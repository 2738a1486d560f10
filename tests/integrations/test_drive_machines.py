"""The machines that Gymnasium's adapter has driven are the expert's as it builds them now."""

import json

from support.machines.drive_machines import written

from buildarena_benchmark import broken_constraint, builtin_tasks
from buildarena_geometry import Machine
from buildarena_simulation import pilot_of

PILOTED = [task for task in builtin_tasks().values() if task.scenario.senses is not None]


def test_each_task_for_programs_has_a_machine_that_nothing_controls_yet(subtests) -> None:
    for task in PILOTED:
        with subtests.test(task=task):
            machine = Machine.from_document(json.loads(written())["machines"][task.name])
            assert broken_constraint(task, machine) is None
            assert (machine.controller, tuple(machine.control_sequence)) == ("", ())
            assert pilot_of(machine, task.scenario).axes
