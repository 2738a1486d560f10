"""Machines that throw a boulder: an arm on a swivel that springs whip round."""

# BuildArena benchmark data, not for training corpora:
# canary 3ab839c7-e533-462b-9729-71495c1ee1f6

import math
from dataclasses import dataclass
from typing import Final

from buildarena_benchmark.experts.design import Design, Designs, keyed, one_part
from buildarena_benchmark.experts.drafting import (
    DOWN,
    EAST,
    NORTH,
    SOUTH,
    UP,
    WEST,
    Direction,
    Draft,
)
from buildarena_benchmark.experts.programs import listed, program_text

_FRONT = 4
"""Blocks of the foot in front of the post."""
_BEGINS_S = (1.52, 1.6, 1.68, 1.76, 1.84)
"""Time at which the springs pull, by seed, seconds."""
_LASTS_S = 4.0
"""Duration for which springs pull that are to contract all the way, seconds."""

_HIGH = """\
  { 9.1, 5, 4, 4 }, { 11.0, 5, 5, 2 }, { 11.3, 5, 5, 3 }, { 12.0, 5, 5, 1 }, { 12.6, 5, 5 },
  { 14.9, 5, 5, 4 }, { 15.5, 5, 4, 5 }, { 15.8, 5, 6, 2 },"""
"""Height of each shot above a place 24 north, as a table of the program's."""


@dataclass(frozen=True, kw_only=True)
class Shape:
    """Parameters of a catapult's throw.

    Attributes:
        arm: Length of the arm behind the swivel, blocks.
        tail: Length of the arm in front of it, which the springs pull down, blocks.
        post: Height of the post, blocks.
        back: Length of the foot behind the post, blocks.
        lean_deg: Angle by which the arm hangs down behind: so its tip rests on the ground.
        cup_deg: Angle by which the cup leans outwards on the arm: the boulder rolls out of it in
            time.
        springs: Number of springs that pull, of seven.
        aside: Distance of the starting block to the east of the foot.
        ahead: Number of the foot's blocks to the north of the starting block.
    """

    arm: int = 6
    tail: int = 4
    post: int = 4
    back: int = 8
    lean_deg: float = 38.7
    cup_deg: float = 10.0
    springs: int = 7
    aside: int = 0
    ahead: int = 0


def catapult(seed: int) -> Design:
    """Return a catapult whose springs all pull at one key."""
    draft, springs, _ = catapult_draft()
    return one_part(
        draft,
        "catapult",
        "A foot of 12, a post of 4, an arm of 6 with a tail of 4, 7 springs",
        overall="An arm on a swivel with a cup behind and springs in front, on a long foot.",
        control=keyed(
            "All springs draw together once the boulder lies still.",
            [(spring, "contract", "Alpha1") for spring in springs],
            [(_BEGINS_S[seed % len(_BEGINS_S)], "Alpha1", _LASTS_S)],
        ),
    )


def ring_shooter(seed: int) -> Design:
    """Return the same catapult in the middle: its program pulls more springs for higher rings."""
    draft, springs, _ = catapult_draft(Shape(aside=3))
    return one_part(
        draft,
        "catapult",
        "A foot of 12, a post of 4, an arm of 6 with a tail of 4, 7 springs",
        overall="A catapult whose arm swings above x = 0; fewer springs throw less far.",
        program=program_text(
            __package__,
            "throwing",
            springs=listed(springs),
            begins=f"{_BEGINS_S[seed % len(_BEGINS_S)]:g}",
            shots=_HIGH,
            axis="z",
            level="0",
        ),
    )


def catapult_draft(shape: Shape = Shape()) -> tuple[Draft, list[str], str]:
    """Return the machine, the ids of its springs, and that of its boulder."""
    draft, lean = Draft(modules="all"), shape.lean_deg
    base = [draft.start("the front of the foot"), *draft.row("1", WEST, shape.aside)][-1]
    before = draft.row(base, NORTH, shape.ahead)[::-1]
    beam = [*before, base, *draft.row(base, SOUTH, _FRONT + shape.back - shape.ahead)]
    foot, anchor, west = _feet(draft, beam)
    post = draft.row(beam[_FRONT], UP, shape.post)
    _stays(draft, beam, post, west)
    swivel = draft.attach(post[-1], EAST, "Swivel")
    draft.do("twist_block", block_id=swivel, angle=-lean)
    back, ahead, above, below = (leaning(way, lean) for way in (SOUTH, NORTH, UP, DOWN))
    hub = draft.attach(swivel, EAST)
    arm, tail = draft.row(hub, back, shape.arm), draft.row(hub, ahead, shape.tail)
    tip = draft.attach(arm[-1], EAST)
    draft.do("twist_block", block_id=tip, angle=-shape.cup_deg)
    out = leaning(UP, lean + shape.cup_deg)
    boulder = draft.attach(draft.attach(tip, out, "Bomb Holder"), out, "Boulder")
    mast = draft.row(hub, above, 2)[-1]
    for end, way in ((arm[3], back), (tail[-1], ahead)):
        draft.connect(mast, end, way, above)
        draft.connect(mast, end, EAST)
    pulls = (
        (tail[-1], below, anchor, UP),
        (tail[-1], EAST, anchor, EAST),
        (tail[-1], ahead, anchor, NORTH),
        (tail[-1], WEST, foot, UP),
        (tail[-2], EAST, foot, NORTH),
        (tail[-2], below, anchor, SOUTH),
        (tail[-2], WEST, beam[1], DOWN),
    )
    for end, way, base, side in pulls[: shape.springs]:
        draft.connect(end, base, way, side, connector="Spring")
    links = draft.machine.connectors.values()
    return draft, [link.id for link in links if link.module.name == "Spring"], boulder


def _feet(draft: Draft, beam: list[str]) -> tuple[str, str, str]:
    """Build heavy feet to both sides; return the eastern front's blocks, and the western one."""
    eastern = draft.attach(beam[1], EAST)
    anchor = draft.attach(eastern, EAST)
    draft.attach(draft.attach(beam[1], WEST), WEST, "Log", note="weight")
    draft.attach(anchor, EAST, "Log", note="weight")
    for base in (beam[_FRONT], beam[-1]):
        west = draft.attach(base, WEST)
        for foot, side in ((west, WEST), (draft.attach(base, EAST), EAST)):
            draft.attach(foot, side, "Log", note="weight")
        if base == beam[_FRONT]:
            middle = west
    return eastern, anchor, middle


def _stays(draft: Draft, beam: list[str], post: list[str], west: str) -> None:
    """Return the braces from the top of the post to the foot, and along the foot behind it."""
    draft.connect(post[-1], beam[_FRONT - 2], NORTH, UP)
    draft.connect(post[-1], beam[1], NORTH, UP)
    draft.connect(post[-1], beam[_FRONT + 6], SOUTH, UP)
    draft.connect(post[-1], west, WEST, UP)
    draft.connect(post[-2], beam[_FRONT - 1], NORTH, UP)
    draft.connect(post[-2], beam[_FRONT + 1], SOUTH, UP)
    for side in (EAST, WEST):
        draft.connect(beam[_FRONT + 1], beam[_FRONT + 5], side)


def leaning(way: Direction, angle_deg: float) -> Direction:
    """Return a direction turned about the east axis: what looked south looks down a little."""
    x, y, z = way
    cosine, sine = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    return (x, y * cosine - z * sine, y * sine + z * cosine)


DESIGNS: Final[Designs] = {
    "throw-1": catapult,
    "throw-4": ring_shooter,
}
