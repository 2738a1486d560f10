"""Flyers: gliders with the tail behind or ahead, and machines that hang under balloons."""

from collections.abc import Sequence

from support.machines.drafts import KeyedDraft

from buildarena_geometry import Machine
from buildarena_worker.builtin.designs.drafting import EAST, NORTH, SIDES, SOUTH, UP, WEST

WING = "Wing Panel"


def glider(
    *,
    nose: int = 5,
    boom: int = 7,
    span: int = 2,
    incidence: float = 6.0,
    tail: int = 1,
    tail_incidence: float = 0.0,
) -> Machine:
    """Wings on a fuselage, a smaller tail behind them.

    Args:
        nose: Blocks ahead of the wings, for balance.
        boom: Blocks from the wings to the tail.
        span: Panels on each side.
        incidence: Of the wings, degrees; their front is higher above 0.
        tail: Panels on each side of the tail.
        tail_incidence: Of the tail, degrees.
    """
    draft = KeyedDraft(modules="workshop")
    middle = draft.start()
    draft.row(middle, NORTH, nose)
    end = draft.row(middle, SOUTH, boom)[-1]
    _wing(draft, middle, span, incidence)
    _wing(draft, end, tail, tail_incidence)
    return draft.machine


def canard(
    *, ahead: int = 7, behind: int = 2, span: int = 2, incidence: float = 5.0, fore: float = 8.0
) -> Machine:
    """The smaller wing ahead of the larger one.

    Args:
        ahead: Blocks from the main wing to the foreplane.
        behind: Blocks behind the main wing.
        span: Panels on each side of the main wing.
        incidence: Of the main wing, degrees.
        fore: Of the foreplane, degrees: more than the main wing's, so that it stalls first.
    """
    draft = KeyedDraft(modules="workshop")
    middle = draft.start()
    front = draft.row(middle, NORTH, ahead)[-1]
    draft.row(middle, SOUTH, behind)
    _wing(draft, middle, span, incidence)
    _wing(draft, front, 1, fore)
    draft.row(front, NORTH, 2)
    return draft.machine


def balloons(count: int = 4, *, arm: int = 3, rise_s: float = 5.2, begin_s: float = 1.5) -> Machine:
    """A cross whose middle takes the cargo, under two or four square balloons.

    Args:
        count: 2 or 4.
        arm: Blocks from the middle to a balloon.
        rise_s: For how long they rise, seconds.
        begin_s: When they begin to, seconds.
    """
    draft = KeyedDraft(modules="workshop")
    middle = draft.start()
    ends = [draft.row(middle, side, arm)[-1] for side in SIDES]
    for end in ends[:count]:
        draft.bind(draft.attach(end, UP, "Sqr Balloon"), "rise", "UpArrow")
    for end in ends[count:]:
        draft.attach(end, UP)
    draft.press("UpArrow", begin_s, rise_s)
    return draft.machine


def _wing(draft: KeyedDraft, base: str, panels: int, incidence: float) -> None:
    sides: Sequence[tuple[tuple[int, int, int], int]] = ((EAST, 1), (WEST, -1))
    for side, sense in sides:
        root = draft.attach(base, side, WING)
        draft.turn_axis(root, 1, UP, further_deg=-sense * incidence)
        for _ in range(panels - 1):
            root = draft.attach(root, side, WING)
