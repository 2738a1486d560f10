"""Machines that move a boulder in ways that are no throw."""

from support.machines.drafts import KeyedDraft

from buildarena_benchmark.experts.drafting import EAST, SOUTH, UP, WEST
from buildarena_geometry import Machine


def car_with_boulder() -> Machine:
    """A car that carries its boulder north and brakes at the line."""
    draft = KeyedDraft(modules="all")
    start = draft.start()
    beam = draft.row(start, SOUTH, 3)
    for base in (start, beam[-1]):
        for side in (EAST, WEST):
            draft.bind(draft.wheel(base, side), "spinning_forward", "UpArrow")
    draft.attach(draft.attach(beam[1], UP, "Bomb Holder"), UP, "Boulder")
    draft.press("UpArrow", 1.0, 3.0)
    return draft.machine
