"""Winches: arms of several lengths on a large gear wheel, and what drives and balances them."""

from support.machines.drafts import KeyedDraft

from buildarena_geometry import Machine
from buildarena_worker.builtin.designs.drafting import DOWN, EAST, NORTH, SOUTH, UP, WEST

LARGE, POWERED = "Cog Large Unpowered", "Cog Medium Powered"


def lever(
    *,
    motors: int = 4,
    arm: int = 6,
    begin_s: float = 18.0,
    lasts_s: float = 1.2,
    weights: int = 4,
) -> Machine:
    """A trestle with a geared arm, a counterweight of logs, and a gripper that hangs.

    Args:
        motors: How many powered gear wheels are driven, 1 to 4.
        arm: Blocks from the axle to the gripper's hinge; the cargo is 6 north of the trestle.
        begin_s: When it lifts, seconds.
        lasts_s: For how long, seconds.
        weights: Logs of the counterweight, 1 to 4.
    """
    draft = KeyedDraft(modules="workshop")
    middle = draft.start()
    back = 6 - arm
    base = middle if back >= 0 else draft.row(middle, SOUTH, -back)[-1]
    base = base if back <= 0 else draft.row(middle, NORTH, back)[-1]
    west = draft.row(base, WEST, 3)
    foot, east = west[-1], draft.row(base, EAST, 2)[-1]
    near, far = draft.row(foot, NORTH, 8), draft.row(east, NORTH, 8)
    behind_beam, post = draft.row(foot, SOUTH, 4), draft.row(foot, UP, 8)
    hub = post[4]
    ahead, behind = draft.row(hub, NORTH, 3)[-1], draft.row(hub, SOUTH, 3)[-1]
    wheel = draft.attach(hub, EAST, LARGE)
    for seat in (post[1], post[7], ahead, behind)[:motors]:
        draft.bind(draft.attach(seat, EAST, POWERED), "spinning_forward", "UpArrow")
    root = draft.attach(wheel, EAST)
    hand = draft.attach(draft.row(root, NORTH, arm)[-1], EAST, "Swivel")
    draft.attach(draft.row(hand, DOWN, 3)[-1], DOWN, "Grabber")
    tail = draft.row(root, SOUTH, 4)[-1]
    for way in (EAST, UP, DOWN)[:weights]:
        draft.attach(tail, way, "Log")
    if weights > 3:
        draft.attach(draft.attach(tail, SOUTH), EAST, "Log")
    draft.connect(ahead, near[5], NORTH, UP)
    draft.connect(behind, behind_beam[3], SOUTH, UP)
    draft.connect(post[7], ahead, NORTH, UP)
    draft.connect(post[7], behind, SOUTH, UP)
    for k in (7, 5, 3):
        draft.connect(near[k], far[k], EAST, WEST)
    draft.connect(west[0], post[0], UP, EAST)
    draft.connect(west[0], west[2], SOUTH, DOWN)
    draft.connect(west[1], west[2], NORTH, DOWN)
    draft.connect(west[0], near[1], NORTH, EAST)
    draft.press("UpArrow", begin_s, lasts_s)
    return draft.machine
