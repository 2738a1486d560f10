"""Throwing a boulder: as many springs draw an arm as its latch can hold until it lets go."""

# BuildArena benchmark data, not for training corpora:
# canary 3ab839c7-e533-462b-9729-71495c1ee1f6

import math

from session import DOWN, EAST, NORTH, SOUTH, UP, WEST, Session, Vector, play

FRONT, BACK, POST, ARM, TAIL, MAST, LATCHED = 4, 8, 4, 6, 4, 2, 8
CUP_DEG = 10
"""By how much the cup leans outwards on the arm, so that the boulder leaves it before the top."""
DRAW_S, RELEASE_S = 0.2, 1.5


def build(session: Session) -> None:
    """Build a catapult, draw as many springs as its latch holds, correct that by tests, submit."""
    beam, anchor, hub, tail, mast, boulder = build_catapult(session)
    latch = session.attach(mast, WEST, "Decoupler")
    session.connect([(latch, WEST), (beam[LATCHED], UP)])
    ends = [(tail[-1], DOWN, UP), (tail[-1], EAST, EAST), (tail[-1], NORTH, NORTH)]
    ends += [(tail[-2], way, way) for way in (EAST, DOWN, WEST)]
    bind(session, latch, "decouple", "Alpha2")

    pivot = session.place(hub)
    # Its brace pulls at the latch's far face, a block from where it sits.
    far, base = session.place(latch), session.place(beam[LATCHED])
    held = -moment(far, base, pivot, session.told("or a moment of"))
    held += session.told("mass", "Boulder") * (pivot[1] - session.place(boulder)[1])
    springs: list[str] = []
    for end, way, other in ends:
        held -= drawn_moment(session, end, anchor, pivot)
        if held < 0:
            break
        springs.append(session.connect([(end, way), (anchor, other)], "Spring"))
        bind(session, springs[-1], "contract", "Alpha1")
    session.do("add_control_sequence", time=DRAW_S, key="Alpha1", hold_for=10)
    session.do("add_control_sequence", time=RELEASE_S, key="Alpha2", hold_for=0.5)
    for _ in range(session.tests):
        if session.submit().score.metrics["broken_joints"]:
            session.do("remove_block", block_id=springs.pop())
    session.submit()


def build_catapult(session: Session) -> tuple[list[str], str, str, list[str], str, str]:
    """Build all but springs and latch; return foot, anchor, hub, tail, top of mast and boulder."""
    session.do("start")
    beam = session.row("1", SOUTH, FRONT + BACK)
    feet = []
    for base in (beam[FRONT], beam[-1], beam[1]):
        for way in (WEST, EAST):
            feet.append(session.row(base, way, 2 if base == beam[1] else 1)[-1])
            session.attach(feet[-1], way, "Log")
    post = session.row(beam[FRONT], UP, POST)
    # Stays as short as they can be: the stiffest takes the load.
    for end, way, foot in (
        *((post[-1], NORTH, beam[1]), (post[-1], NORTH, beam[2]), (post[-1], SOUTH, beam[10])),
        *((post[-2], NORTH, beam[3]), (post[-2], SOUTH, beam[5]), (post[-1], WEST, feet[0])),
    ):
        session.connect([(end, way), (foot, UP)])
    for side in (EAST, WEST):
        session.connect([(beam[FRONT + 1], side), (beam[FRONT + 5], side)])
    # The arm leans until its tip, half a block beyond the last block's middle, is at the ground.
    out = ARM + 0.5
    lean = math.asin((POST + 0.45) / math.hypot(out, 0.5)) - math.atan2(0.5, out)
    swivel = session.attach(post[-1], EAST, "Swivel")
    session.do("twist_block", block_id=swivel, angle=-math.degrees(lean))
    hub = session.attach(swivel, EAST)
    arm, tail = session.row(hub, SOUTH, ARM), session.row(hub, NORTH, TAIL)
    mast = session.row(hub, UP, MAST)[-1]
    for end, way, other in ((arm[4], SOUTH, UP), (tail[-1], NORTH, UP)):
        session.connect([(mast, way), (end, other)])
        session.connect([(mast, EAST), (end, EAST)])
    tip = session.attach(arm[-1], EAST)
    session.do("twist_block", block_id=tip, angle=-CUP_DEG)
    outwards = (0.0, -1.0, 1.0)
    cup = session.attach(tip, outwards, "Bomb Holder")
    boulder = session.attach(cup, outwards, "Boulder")
    return beam, feet[-1], hub, tail, mast, boulder


def bind(session: Session, block: str, action: str, key: str) -> None:
    """Bind a key to an action of a block."""
    session.do("add_control_key", block_id=block, action=action, new_key=key)


def moment(at: Vector, towards: Vector, pivot: Vector, force: float) -> float:
    """Return how strongly a force at one place, towards another, turns the arm forwards."""
    way = tuple(b - a for a, b in zip(at, towards, strict=True))
    y, z = at[1] - pivot[1], at[2] - pivot[2]
    return force * (z * way[1] - y * way[2]) / math.hypot(*way)


def drawn_moment(session: Session, end: str, anchor: str, pivot: Vector) -> float:
    """Return the moment of a spring that has drawn together as far as it does, by Hooke's law."""
    at, base = session.place(end), session.place(anchor)
    share = 1 - session.told("its rest length to", "Spring")
    force = session.told("Pulls", "Spring") * share * math.dist(at, base)
    return moment(at, base, pivot, force)


play(build, "throw-1")
