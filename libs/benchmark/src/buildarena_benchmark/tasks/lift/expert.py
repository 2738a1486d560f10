"""Rockets: water cannons that spray down, each heated by a torch below its outlet."""

# BuildArena benchmark data, not for training corpora:
# canary 3ab839c7-e533-462b-9729-71495c1ee1f6

from collections.abc import Sequence
from typing import Final

from buildarena_benchmark.experts.design import Design, Designs, PartDesign, keyed, one_part
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

PAIRS: tuple[tuple[Direction, ...], ...] = (SIDES, (EAST, WEST), (NORTH, SOUTH))
"""On which sides the cannons sit, by seed: opposite ones, so that the thrust is balanced."""
CANNONS = "cannons round the starting block, spraying down, each with a torch two blocks below"


def engine(seed: int) -> Design:
    """Return a rocket engine for itself."""
    sides = PAIRS[seed % len(PAIRS)]
    return one_part(
        _engine(sides, load=0),
        "engine",
        f"{len(sides)} {CANNONS}",
        overall="A rocket engine: heated water cannons that push one way.",
    )


def rocket(seed: int) -> Design:
    """Return a rocket as one structure: the engine with a nose of up to three blocks."""
    sides, load = PAIRS[seed % len(PAIRS)], seed % 4
    return one_part(
        _engine(sides, load=load),
        "rocket",
        f"{len(sides)} {CANNONS}; a nose of {load} blocks",
        overall="A rocket: a heated engine under a short nose, balanced about its axis.",
    )


def framed_rocket(seed: int) -> Design:
    """Return an engine under a cross-shaped frame, held together by four braces."""
    arm = 2 + seed % 2
    frame = Draft()
    middle = frame.start("middle of the frame")
    for side in SIDES:
        frame.row(middle, side, arm)
    engine_draft = _engine(SIDES, load=0)
    rocket = Draft({"engine": engine_draft.machine, "frame": frame.machine})
    rocket.do("add_machine", machine_id="frame", init_shift=[0, 0, 2], init_rotation=[0, 0, 0])
    rocket.do("add_machine", machine_id="engine", init_shift=[0, 0, 0], init_rotation=[0, 0, 0])
    for side in SIDES:
        rocket.connect("A_1", "B_1", side, UP)
    parts = {
        "engine": (engine_draft, f"{len(SIDES)} {CANNONS}"),
        "frame": (frame, f"A flat cross with arms of {arm} blocks"),
    }
    return Design(
        overall="A rocket of two sub-structures: an engine, and a frame above it on four braces.",
        parts={
            name: PartDesign(description=description, actions=tuple(draft.actions))
            for name, (draft, description) in parts.items()
        },
        assembly=tuple(rocket.actions),
    )


def payload_rocket(seed: int) -> Design:
    """Return four engines round a gripper, each on its own post next to the cargo."""
    draft = Draft(modules="workshop")
    middle = draft.start("over the cargo")
    gripper = draft.attach(middle, DOWN, "Grabber")
    cannons = []
    for side in SIDES:
        end = draft.row(middle, side, 2)[-1]
        cannons.append(draft.cannon(end, side, DOWN))
        draft.torch(draft.row(end, DOWN, 2)[-1], side, UP)
    # A cargo that grows heavier tips it over in most varied worlds, where it is off the middle.
    begin = round(0.2 + 0.03 * (seed % 4), 2)
    return one_part(
        draft,
        "rocket",
        "A cross, a post of 3 with a cannon and a torch at each end, a gripper",
        overall="Four heated cannons round a gripper that holds the cargo between their posts.",
        control=keyed(
            "It fires all cannons at once, soon, while the cargo is light.",
            [(gripper, "grab", "Alpha2"), *((it, "hold_to_fire", "Alpha1") for it in cannons)],
            [(begin, "Alpha1", 12.0)],
        ),
    )


def _engine(sides: Sequence[Direction], *, load: int) -> Draft:
    draft = Draft()
    middle = draft.start("between the cannons")
    for side in sides:
        draft.cannon(middle, side, DOWN)
    low = draft.row(middle, DOWN, 2)[-1]
    for side in sides:
        draft.torch(low, side, UP)
    draft.row(middle, UP, load)
    return draft


DESIGNS: Final[Designs] = {
    "lift-1": engine,
    "lift-2": rocket,
    "lift-3": framed_rocket,
    "lift-4": payload_rocket,
}
