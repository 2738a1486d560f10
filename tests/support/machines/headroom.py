"""Machines for the tasks with headroom: honest ones, and ones that break a rule."""

from collections.abc import Sequence

from support.machines.building import KeyedDraft

from buildarena_benchmark.experts.design import Design
from buildarena_benchmark.experts.drafting import DOWN, EAST, NORTH, SOUTH, UP, WEST
from buildarena_geometry import Machine

Presses = Sequence[tuple[float, str, float]]
"""Time, key and duration, seconds."""


def drafted(
    design: Design, presses: Presses | None = None, *, modules: str = "workshop"
) -> Machine:
    """The machine of an expert's design of one sub-structure, driven by other presses if given."""
    draft = KeyedDraft(modules=modules)
    (part,) = design.parts.values()
    for name, arguments in part.actions:
        draft.do(name, **arguments)
    control = design.control or {}
    for bound in control.get("control_config", ()):
        for key in bound["keys"]:
            draft.bind(bound["block"], bound["action"], key)
    if presses is None:
        presses = [(p["time"], p["key"], p["hold_for"]) for p in control["control_sequence"]]
    for time, key, hold_for in presses:
        draft.press(key, time, hold_for)
    return draft.machine


def propped_beam(
    gap: int, places: Sequence[int] = (), *, height: int = 5, foot: int = 0
) -> Machine:
    """A braced row over a gap with columns below it.

    Args:
        gap: Width of the gap, units.
        places: Where the columns are, blocks north of the middle.
        height: Of the columns, in blocks.
        foot: How far a cross of blocks reaches from the foot of each.
    """
    draft = KeyedDraft()
    middle = draft.start()
    half = gap // 2 + 1
    ahead, behind = draft.row(middle, NORTH, half), draft.row(middle, SOUTH, half)
    row = [*reversed(behind), middle, *ahead]
    for first, second in zip(row, row[6:], strict=False):
        draft.connect(first, second, UP)
    for place in places:
        low = draft.row(row[half + place], DOWN, height)[-1]
        for side in (EAST, WEST, NORTH, SOUTH):
            draft.row(low, side, foot)
    return draft.machine
