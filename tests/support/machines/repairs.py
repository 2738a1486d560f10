"""What may be tried on a car that is given with faults, without finding them."""

from collections.abc import Callable

from support.machines.building import KeyedDraft

from buildarena_benchmark import Task
from buildarena_benchmark.experts import expert_designs
from buildarena_benchmark.experts.drafting import EAST, NORTH, SOUTH, WEST
from buildarena_benchmark.families.cars import KEY, PRESS, drawn_car
from buildarena_benchmark.families.given import given_machine
from buildarena_geometry import Block, Machine


def faulty(task: Task) -> Machine:
    """The car of a task as a builder gets it."""
    assert task.beginning is not None
    return given_machine(task.beginning, task.seed)


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


def faulty_side(task: Task) -> int:
    assert task.beginning is not None
    return next(w.side for w in drawn_car(task.seed, task.beginning.faults).wheels if w.fault)


def without_that_side(task: Task) -> Machine:
    """Every wheel of the faulty side is taken off."""
    machine = faulty(task)
    for wheel in wheels_of(machine, faulty_side(task)):
        machine.act("remove_block", {"block_id": wheel.id})
    return machine


def fewer_on_the_other_side(task: Task) -> Machine:
    """As many wheels are taken off at the other side as have faults."""
    machine = faulty(task)
    for wheel in wheels_of(machine, -faulty_side(task))[:3]:
        machine.act("remove_block", {"block_id": wheel.id})
    return machine


def faulty_as_well(task: Task) -> Machine:
    """At the other side as many wheels get a key that is never pressed."""
    machine = faulty(task)
    for wheel in wheels_of(machine, -faulty_side(task))[:3]:
        told = {"block_id": wheel.id, "action": "spinning_forward", "new_key": "Alpha9"}
        assert machine.act("change_control_key", told).ok
    return machine


TRICKS: dict[str, Callable[[Task], Machine]] = {
    "as it is": faulty,
    "no wheels at that side": without_that_side,
    "fewer at the other side": fewer_on_the_other_side,
    "faulty at the other side as well": faulty_as_well,
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
