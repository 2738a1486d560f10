"""What may be tried on a car that is given with faults, without finding them."""

from collections.abc import Callable

from support.machines.building import KeyedDraft

from buildarena_benchmark import Task
from buildarena_benchmark.experts import expert_designs
from buildarena_benchmark.experts.drafting import EAST, NORTH, SOUTH, WEST
from buildarena_benchmark.families.cars import KEY, PRESS
from buildarena_benchmark.families.initial_machine import make_initial_machine
from buildarena_geometry import Block, Machine


def faulty(task: Task) -> Machine:
    """The car of a task as a builder gets it."""
    assert task.initial_machine is not None
    return make_initial_machine(task.initial_machine, task.seed)


def repaired(task: Task, count: int | None = None) -> Machine:
    """The car with the expert's edits, or the first actions of them."""
    machine = faulty(task)
    (part,) = expert_designs()[task.name](task.seed).parts.values()
    for name, arguments in list(part.actions)[:count]:
        assert machine.act(name, arguments).ok
    return machine


def wheels_of(machine: Machine, side: int) -> list[Block]:
    """The wheels at a side of the frame, 1 in the east and -1 in the west."""
    wheels = [block for block in machine.blocks.values() if block.module.spins]
    return [wheel for wheel in wheels if wheel.axis_xyz[0] * side > 0]


def faulty_wheels(machine: Machine) -> list[Block]:
    """The wheels that are not as those of a car that drives: bound to another key, or backward."""
    wheels = [*wheels_of(machine, 1), *wheels_of(machine, -1)]
    return [wheel for wheel in wheels if KEY not in wheel.bindings.get("spinning_forward", ())]


def without_them(task: Task) -> Machine:
    """Every wheel whose keys are wrong is taken off."""
    machine = faulty(task)
    for wheel in faulty_wheels(machine):
        assert machine.act("remove_block", {"block_id": wheel.id}).ok
    return machine


def all_keys(task: Task) -> Machine:
    """Every wheel gets the key, and none is turned round or put where it is missing."""
    machine = faulty(task)
    for wheel in faulty_wheels(machine):
        told = {"block_id": wheel.id, "action": "spinning_forward", "new_key": KEY}
        assert machine.act("change_control_key", told).ok
    return machine


def all_turned(task: Task) -> Machine:
    """Every wheel is turned round."""
    machine = faulty(task)
    for wheel in (*wheels_of(machine, 1), *wheels_of(machine, -1)):
        assert machine.act("flip_spin", {"block_id": wheel.id}).ok
    return machine


TRICKS: dict[str, Callable[[Task], Machine]] = {
    "as it is": faulty,
    "without the wheels whose keys are wrong": without_them,
    "every wheel has the key": all_keys,
    "every wheel is turned": all_turned,
}


def new_car() -> Machine:
    """A car of four wheels that drives straight, built anew."""
    draft = KeyedDraft()
    start = draft.start()
    for end in (draft.row(start, NORTH, 2)[-1], draft.row(start, SOUTH, 2)[-1]):
        for side in (EAST, WEST):
            draft.bind(draft.wheel(draft.attach(end, side), side), "spinning_forward", KEY)
    draft.press(KEY, *PRESS)
    return draft.machine
