"""Repairs: the edits that put right what is wrong with a machine that a task gives."""

# BuildArena benchmark data, not for training corpora:
# canary 3ab839c7-e533-462b-9729-71495c1ee1f6

from __future__ import annotations

from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.families.cars import EAST as EAST_SIDE
from buildarena_benchmark.families.cars import KEY, Wheel, drawn_car
from buildarena_worker.builtin.designs.design import Design, PartDesign
from buildarena_worker.builtin.designs.drafting import EAST, WEST, Draft

ELSEWHERE = "DownArrow"
"""A key that is never pressed."""


def repaired_car(seed: int) -> Design:
    """The car of a seed, each wheel that has a fault put right by one edit.

    Args:
        seed: The job's: it draws the car.
    """
    task = builtin_tasks()["repair-1"].drawn(seed)
    assert task.beginning is not None  # noqa: S101 - the task's own file
    draft = Draft()
    draft.machine = task.new_machine(draft.machine.catalogue)
    car = drawn_car(seed, task.beginning.faults)
    # Blocks other than wheels were built in the order of their places.
    places = dict(zip(car.blocks, draft.machine.blocks, strict=False))
    for wheel in car.wheels:
        if wheel.fault:
            _mend(draft, places[wheel.place], wheel)
    described = f"The car, of which {task.beginning.faults} wheels are put right"
    return Design(
        overall="The car that stands there, repaired.",
        parts={"car": PartDesign(description=described, actions=tuple(draft.actions))},
    )


def _mend(draft: Draft, base: str, wheel: Wheel) -> None:
    side = EAST if wheel.side == EAST_SIDE else WEST
    if wheel.fault == "missing":
        made = draft.wheel(base, side)
    else:
        face = draft.face(base, side)
        made = next(b.id for b in draft.machine.blocks.values() if b.mount == (base, face))
    if wheel.fault == "turned":
        draft.do("flip_spin", block_id=made)
        return
    draft.do("change_control_key", block_id=made, action="spinning_forward", new_key=KEY)
    if wheel.fault == "backward":
        key = {"action": "spinning_backward", "new_key": ELSEWHERE}
        draft.do("change_control_key", block_id=made, **key)
