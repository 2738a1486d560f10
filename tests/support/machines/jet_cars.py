"""Cars that heated cannons push, whatever their wheels do."""

from typing import Literal

from support.machines.drafts import KeyedDraft

from buildarena_worker.builtin.designs.drafting import EAST, NORTH, SOUTH, UP, WEST


def jet_car(
    wheels: Literal["braked", "backward", "tapped", "driven"] = "braked",
    *,
    cannons: int = 2,
    fires_s: float = 30.0,
) -> KeyedDraft:
    """A car on four powered wheels with cannons that spray south, each heated by a torch.

    Args:
        wheels: What their keys do while it is pushed north: nothing; drive it south; drive it north
            for a moment first, or all the time.
        cannons: How many fire, 0 to 2.
        fires_s: For how long, seconds.
    """
    draft = KeyedDraft()
    start = draft.start()
    spine = draft.row(start, SOUTH, 4)
    front = draft.row(start, NORTH, 2)[-1]
    high = draft.row(start, UP, 1)[-1]
    low = draft.row(high, SOUTH, 2)[-1]
    for side in (EAST, WEST)[:cannons]:
        cannon = draft.cannon(high, side, SOUTH)
        draft.torch(low, side, NORTH)
        draft.bind(cannon, "hold_to_fire", "Alpha1")
    for base in (front, spine[-1]):
        for side in (EAST, WEST):
            wheel = draft.wheel(draft.attach(base, side), side)
            draft.bind(wheel, "spinning_forward", "UpArrow")
            draft.bind(wheel, "spinning_backward", "DownArrow")
    if wheels != "braked":
        key, hold_s = {
            "backward": ("DownArrow", 30.0),
            "tapped": ("UpArrow", 0.3),
            "driven": ("UpArrow", 30.0),
        }[wheels]
        draft.press(key, 0.5, hold_s)
    if cannons:
        draft.press("Alpha1", 1.0, fires_s)
    return draft
