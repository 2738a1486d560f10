"""Machines that a latch holds under tension until a decoupler lets go of it."""

from collections.abc import Callable

from support.machines.building import KeyedDraft
from support.machines.trials import press

from buildarena_benchmark.experts.drafting import (
    DOWN,
    EAST,
    NORTH,
    SIDES,
    SOUTH,
    UP,
    WEST,
    Direction,
    Draft,
)
from buildarena_benchmark.tasks.throwing.expert import Shape, catapult_draft, leaning
from buildarena_geometry import KeyPress, Machine

RELEASE_S = 1.5
PRESSES: tuple[KeyPress, ...] = (press("Alpha1", 0.2, 8.0), press("Alpha2", RELEASE_S, 0.5))
"""The springs draw, then the latch lets go."""
_LEAN_DEG = Shape().lean_deg
_BACK, _UNDER = leaning(SOUTH, _LEAN_DEG), leaning(DOWN, _LEAN_DEG)

Latch = tuple[str, Direction, str, Direction]
"""What a decoupler sits on, the side, and which side of what a brace holds to its far end."""
LATCHES: dict[str, tuple[int, tuple[Latch, ...]]] = {
    "beside the arm": (3, (("10", EAST, "46", WEST),)),
    "behind the arm": (2, (("24", UP, "46", _BACK),)),
    "across the arm": (2, (("11", EAST, "46", _BACK),)),
    "on the arm": (3, (("45", WEST, "9", UP),)),
    "two at once": (3, (("10", EAST, "46", WEST), ("24", UP, "46", _BACK))),
    "under the tail": (4, (("15", UP, "49", _UNDER),)),
    "at the post": (2, (("20", UP, "43", _UNDER),)),
    "on the mast": (3, (("55", WEST, "9", UP),)),
}
"""Springs of the catapult, and its latches."""


def latched_catapult(kind: str) -> Machine:
    """A catapult whose drawn springs a latch of `LATCHES` holds."""
    springs, latches = LATCHES[kind]
    draft, found, _ = catapult_draft(Shape(springs=springs))
    for spring in found:
        _bind(draft, spring, "contract", "Alpha1")
    for latch in latches:
        _latch(draft, *latch)
    for each in PRESSES:
        timed = {"time": each.time_s, "key": each.key, "hold_for": each.hold_for_s}
        draft.do("add_control_sequence", **timed)
    return draft.machine


def sprung_arm(springs: int = 2, weights: int = 0) -> KeyedDraft:
    """An arm on a swivel, with springs in front, a latch behind, and logs under both ends."""
    draft, foot = _on_a_foot()
    north, south = _on_a_swivel(draft, north=3, south=3)
    for end in (north[-1], south[-1]):
        top = end
        for _ in range(weights):
            top = draft.attach(top, UP, "Ballast")
    for end, base, side, other in (
        (north[-1], foot[NORTH][-1], DOWN, UP),
        (north[-1], foot[NORTH][-2], EAST, EAST),
    )[:springs]:
        _spring(draft, end, base, side, other)
    _latch(draft, foot[SOUTH][-1], UP, south[-1], DOWN)
    return draft


def _trebuchet() -> KeyedDraft:
    draft, foot = _on_a_foot()
    north, south = _on_a_swivel(draft, north=1, south=4)
    draft.attach(north[-1], DOWN, "Log")
    _latch(draft, foot[SOUTH][-1], UP, south[-1], DOWN)
    return draft


def _crossbow() -> KeyedDraft:
    draft, foot = _on_a_foot(4)
    post = draft.row("1", UP, 2)
    bow = draft.attach(draft.attach(post[-1], UP, "Slider"), UP)
    for side, back in ((EAST, WEST), (WEST, EAST)):
        tip, tower = draft.row(bow, side, 2)[-1], draft.row(foot[side][-1], UP, 9)[-1]
        _spring(draft, tip, tower, UP, back)
    _latch(draft, post[0], SOUTH, bow, SOUTH)
    return draft


def _gate() -> KeyedDraft:
    draft, foot = _on_a_foot()
    hub = draft.attach(draft.attach(draft.row("1", UP, 2)[-1], UP, "Swivel"), UP)
    leaf = draft.row(hub, NORTH, 4)
    tower = draft.row(foot[EAST][-1], UP, 4)
    _spring(draft, leaf[2], tower[-1], EAST, WEST)
    _latch(draft, foot[NORTH][-1], UP, leaf[-1], DOWN)
    return draft


def _drawbridge() -> KeyedDraft:
    draft, foot = _on_a_foot()
    hinge = draft.placed(foot[NORTH][-1], UP, "Hinge", NORTH)
    deck = draft.row(hinge, UP, 5)
    _spring(draft, deck[-1], foot[NORTH][-1], NORTH, NORTH)
    _spring(draft, deck[-1], foot[NORTH][-1], EAST, EAST)
    _latch(draft, draft.row("1", UP, 5)[-1], NORTH, deck[-1], SOUTH)
    return draft


MECHANISMS: dict[str, Callable[[], KeyedDraft]] = {
    "sprung arm": sprung_arm,
    "trebuchet": _trebuchet,
    "crossbow": _crossbow,
    "gate": _gate,
    "drawbridge": _drawbridge,
}
"""Machines whose last latched block moves once the latch lets go."""


def _on_a_foot(length: int = 3) -> tuple[KeyedDraft, dict[Direction, list[str]]]:
    draft = KeyedDraft(modules="all")
    start = draft.start()
    return draft, {side: draft.row(start, side, length) for side in SIDES}


def _on_a_swivel(draft: KeyedDraft, *, north: int, south: int) -> tuple[list[str], list[str]]:
    post = draft.row("1", UP, 5)
    draft.connect(post[-1], "4", EAST, UP)
    hub = draft.attach(draft.attach(post[-1], WEST, "Swivel"), WEST)
    return draft.row(hub, NORTH, north), draft.row(hub, SOUTH, south)


def _spring(draft: Draft, end: str, base: str, side: Direction, other: Direction) -> None:
    draft.connect(end, base, side, other, connector="Spring")
    _bind(draft, list(draft.machine.connectors)[-1], "contract", "Alpha1")


def _latch(draft: Draft, base: str, way: Direction, held: str, side: Direction) -> None:
    decoupler = draft.attach(base, way, "Decoupler")
    _bind(draft, decoupler, "decouple", "Alpha2")
    draft.connect(decoupler, held, way, side)


def _bind(draft: Draft, block: str, action: str, key: str) -> None:
    draft.do("add_control_key", block_id=block, action=action, new_key=key)
