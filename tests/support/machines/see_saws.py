"""See-saws that lift a winch's cargo by a counterweight, with gears beside them for show."""

from support.machines.drafts import KeyedDraft

from buildarena_worker.builtin.designs.drafting import DOWN, EAST, NORTH, SOUTH, UP, WEST

POWERED, LARGE, MEDIUM = "Cog Medium Powered", "Cog Large Unpowered", "Cog Medium Unpowered"


def see_saw(pivot: str = "Swivel", *, show: str = "apart") -> KeyedDraft:
    """A beam on a post over the cargo, with some 36 mass units of logs on its other end.

    Args:
        pivot: What the beam turns on.
        show: Where a powered and a large gear wheel are: "apart" from each other on the post,
            "meshing" there with the key held from the start, "on the beam" with both turning
            there, or "on the line" of the pivot, meshing there and turning free of the beam.
    """
    draft = KeyedDraft(modules="workshop")
    middle = draft.start()
    foot = draft.row(middle, WEST, 3)[-1]
    east = draft.row(middle, EAST, 2)[-1]
    near, far = draft.row(foot, NORTH, 8), draft.row(east, NORTH, 8)
    back, post = draft.row(foot, SOUTH, 4), draft.row(foot, UP, 8)
    ahead, behind = draft.row(post[4], NORTH, 3)[-1], draft.row(post[4], SOUTH, 3)[-1]
    beam = draft.attach(draft.attach(post[7], EAST, pivot), EAST)
    hand = draft.attach(draft.row(beam, NORTH, 6)[-1], EAST, "Swivel")
    draft.attach(draft.row(hand, DOWN, 6)[-1], DOWN, "Grabber")
    arm = draft.row(beam, SOUTH, 6)
    for base in arm[3:]:
        for way, count in ((EAST, 4), (UP, 4), (WEST, 1)):
            log = base
            for _ in range(count):
                log = draft.attach(log, way, "Log")
    draft.attach(arm[-1], SOUTH, "Log")
    draft.connect(beam, arm[-1], UP)
    draft.connect(beam, arm[3], EAST)
    for k in (7, 5, 3):
        draft.connect(near[k], far[k], EAST, WEST)
    for first, second, way, other in (
        (middle, foot, UP, EAST),
        (ahead, near[5], WEST, UP),
        (ahead, near[5], NORTH, UP),
        (behind, back[3], SOUTH, UP),
        (post[7], ahead, NORTH, UP),
        (post[7], behind, SOUTH, UP),
    ):
        draft.connect(first, second, way, other)
    _gears(draft, post, beam, show)
    return draft


def _gears(draft: KeyedDraft, post: list[str], beam: str, show: str) -> None:
    if show == "on the beam":
        large = draft.attach(draft.attach(beam, UP), UP, LARGE)
        draft.attach(large, UP)
        motor = draft.attach(draft.attach(draft.row(beam, EAST, 3)[-1], UP), UP, POWERED)
    elif show == "on the line":
        draft.attach(post[7], WEST, LARGE)
        motor = draft.attach(post[4], WEST, POWERED)
    else:
        draft.attach(post[3], WEST, LARGE)
        motor = draft.attach(post[6 if show == "meshing" else 7], WEST, POWERED)
    if show != "apart":
        draft.bind(motor, "spinning_forward", "UpArrow")
        draft.press("UpArrow", 0.0, 1.2)
