"""Rockets, their engines, and rockets that are assembled."""

from collections.abc import Sequence

from tests.simulation.designs.draft import (
    DOWN,
    EAST,
    NORTH,
    SOUTH,
    UP,
    WEST,
    Actions,
    Direction,
    Draft,
    replayed,
)

SIDES = (EAST, WEST, NORTH, SOUTH)


def rocket(
    sides: Sequence[Direction] = SIDES,
    *,
    heated: bool = True,
    cargo_blocks: int = 0,
    skew: bool = False,
) -> Actions:
    """Cannons round the starting block that spray down, each with a torch two blocks below.

    Args:
        sides: On which sides of the starting block a cannon sits.
        heated: Whether there are torches.
        cargo_blocks: Blocks on top, as dead weight.
        skew: Whether three blocks hang out to the east, so that it tips.
    """
    draft = Draft()
    middle = draft.start()
    for side in sides:
        draft.cannon(middle, side, DOWN)
    low = draft.row(middle, DOWN, 2)[-1]
    if heated:
        for side in sides:
            draft.torch(low, side, UP)
    top = draft.row(middle, UP, max(cargo_blocks, 1 if skew else 0))
    if skew:
        draft.row(top[-1], EAST, 3)
    for block in draft.machine.blocks.values():
        if block.module.kind == "cannon":
            draft.bind(block.id, "hold_to_fire", "Alpha1")
    return draft.actions


def paired_engine() -> Actions:
    """Two cannons side by side share one torch."""
    draft = Draft()
    middle = draft.start()
    draft.cannon(middle, EAST, DOWN)
    side = draft.attach(middle, NORTH)
    draft.cannon(side, EAST, DOWN)
    low = draft.row(middle, DOWN, 2)[-1]
    torch = draft.torch(low, EAST, UP)
    draft.do("shift_block", block_id=torch, shift_real=[0, 0.5, 0])
    for block in draft.machine.blocks.values():
        if block.module.kind == "cannon":
            draft.bind(block.id, "hold_to_fire", "Alpha1")
    return draft.actions


def waist_engine() -> Actions:
    """A cannon and a torch beside it whose flame is level with the cannon's narrow middle."""
    draft = Draft()
    middle = draft.start()
    cannon = draft.cannon(middle, EAST, DOWN)
    post = draft.row(middle, NORTH, 1)[-1]
    low = draft.row(post, DOWN, 1)[-1]
    torch = draft.torch(low, EAST, UP)
    # Flame a quarter off the cannon's side, at the height of its waist.
    draft.do("shift_block", block_id=torch, shift_real=[0, -0.25, -0.125])
    draft.bind(cannon, "hold_to_fire", "Alpha1")
    return draft.actions


def rocket_assembly(
    *, sides: Sequence[Direction] = SIDES, heated: bool = True
) -> tuple[dict[str, Actions], Actions]:
    """An engine under a cross-shaped frame: the sub-structures by name, and the assembly's log.

    Args:
        sides: On which sides of the engine's starting block a cannon sits.
        heated: Whether there are torches.
    """
    draft = Draft()
    middle = draft.start()
    for side in SIDES:
        draft.row(middle, side, 2)
    parts = {"engine": rocket(sides, heated=heated), "frame": draft.actions}
    whole = Draft({name: replayed(actions) for name, actions in parts.items()})
    whole.do("add_machine", machine_id="frame", init_shift=[0, 0, 2])
    whole.do("add_machine", machine_id="engine", init_shift=[0, 0, 0])
    for side in SIDES:
        whole.link("A_1", side, "B_1", UP)
    return parts, whole.actions
