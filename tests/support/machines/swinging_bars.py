"""Cars that drive straight on through a slalom and swing a bar with the starting block ahead."""

from typing import Literal

from support.machines.drafts import KeyedDraft

from buildarena_worker.builtin.designs.drafting import EAST, SOUTH, UP, WEST


def swinging_bar(
    tip: Literal["bare", "heavy", "wheeled"] = "bare",
    *,
    hinge: str = "Steering Hinge",
    drive_s: float = 1.08,
) -> KeyedDraft:
    """A long car behind a hinge, a bar before it, the starting block at the bar's tip.

    Args:
        tip: What is at the tip besides: nothing, two logs, or two wheels that hang free.
        hinge: What the bar swings on.
        drive_s: For how long it drives from one gate to the next, seconds.
    """
    draft = KeyedDraft(modules="workshop")
    start = draft.start()
    if tip == "heavy":
        for side in (EAST, WEST):
            draft.attach(start, side, "Log")
    bar = draft.row(start, SOUTH, 5)
    if tip == "wheeled":
        top = draft.attach(start, UP)
        for side in (EAST, WEST):
            draft.wheel(top, side)
    joint = draft.attach(bar[-1], SOUTH, hinge)
    draft.turn_axis(joint, 0, UP)
    front = draft.attach(joint, SOUTH)
    body = [front, *draft.row(front, SOUTH, 10)]
    for base in (body[0], body[-1]):
        for side in (EAST, WEST):
            wheel = draft.wheel(draft.attach(base, side), side)
            draft.bind(wheel, "spinning_forward", "UpArrow")
    for base in body[1:9:2]:
        draft.attach(base, UP, "Log")
    draft.bind(joint, "turn_left", "LeftArrow")
    draft.bind(joint, "turn_right", "RightArrow")
    draft.press("LeftArrow", 0.2, 0.5)
    for gate in range(5):
        begin = round(0.8 + 2.5 * gate, 2)
        draft.press("UpArrow", begin, drive_s + (0.02 if gate == 0 else 0.0))
        draft.press("LeftArrow" if gate % 2 else "RightArrow", round(begin + 1.3, 2), 0.92)
    return draft
