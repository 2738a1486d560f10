"""Arms that take hold of a cargo: one swings it over a wall, one lifts it by gears."""

# BuildArena benchmark data, not for training corpora:
# canary 3ab839c7-e533-462b-9729-71495c1ee1f6

from typing import Final

from buildarena_benchmark.experts.design import Design, Designs, keyed, one_part
from buildarena_benchmark.experts.drafting import DOWN, EAST, NORTH, SOUTH, UP, WEST, Draft

_DRIVEN = 3
_HALF_WIDTH, _HALF_LENGTH, _TRAY = 2, 3, 2
_LIGHT_S = 0.8
"""Time until which a cargo that grows heavier is light enough for three motors, seconds."""


def loaded_lift(seed: int) -> Design:
    """Return a geared arm with a counterweight.

    Three of its four motors lift: with all four a light cargo slips off.
    """
    draft = Draft(modules="workshop")
    beams, hub, post = _trestle(draft)
    wheel = draft.attach(hub, EAST, "Cog Large Unpowered")
    motors = [draft.attach(base, EAST, "Cog Medium Powered") for base in post]
    root = draft.attach(wheel, EAST)
    hand = draft.attach(draft.row(root, NORTH, 6)[-1], EAST, "Swivel")
    draft.attach(draft.row(hand, DOWN, 3)[-1], DOWN, "Grabber")
    # A unit longer, the weights would brush the ground while the arm rises.
    beam = draft.row(root, SOUTH, 3)[-1]
    for way in (EAST, UP, DOWN):
        draft.attach(beam, way, "Log", note="counterweight")
    draft.attach(draft.attach(beam, SOUTH), EAST, "Log", note="counterweight")
    _brace(draft, beams, post)
    return one_part(
        draft,
        "lift",
        "Two beams on the ground, a post of 8, an arm of 6 on a large wheel",
        overall="A trestle with a geared arm: four motors on one large wheel, a counterweight.",
        control=keyed(
            "3 of the motors lift together, and brake when the key is let go.",
            [(motor, "spinning_forward", "UpArrow") for motor in motors[:_DRIVEN]],
            [(_LIGHT_S + 0.04 * (seed % 4), "UpArrow", 1.3)],
        ),
    )


_Beams = dict[str, list[str]]


def _trestle(draft: Draft) -> tuple[_Beams, str, list[str]]:
    """Build a beam on both sides of the cargo, and a post with seats for a wheel and its motors.

    Returns:
        The beams by name, the block of the large wheel, and those of the motors.
    """
    middle = draft.start("between the beams")
    beams = {"west": draft.row(middle, WEST, 3)}
    foot, east = beams["west"][-1], draft.row(middle, EAST, 2)[-1]
    beams["near"] = draft.row(foot, NORTH, 8)
    beams["far"] = draft.row(east, NORTH, 8)
    beams["back"] = draft.row(foot, SOUTH, 4)
    beams["post"] = draft.row(foot, UP, 8)
    hub = beams["post"][4]
    ahead, behind = draft.row(hub, NORTH, 3)[-1], draft.row(hub, SOUTH, 3)[-1]
    return beams, hub, [beams["post"][1], beams["post"][7], ahead, behind]


def _brace(draft: Draft, beams: _Beams, post: list[str]) -> None:
    """Return the braces of the motors' seats, across the beams, and about the foot."""
    _, top, ahead, behind = post
    west, near_post = beams["west"], beams["near"]
    draft.connect(ahead, near_post[5], NORTH, UP)
    draft.connect(behind, beams["back"][3], SOUTH, UP)
    draft.connect(top, ahead, NORTH, UP)
    draft.connect(top, behind, SOUTH, UP)
    for k in (7, 5, 3):
        draft.connect(near_post[k], beams["far"][k], EAST, WEST)
    draft.connect(west[0], beams["post"][0], UP, EAST)
    draft.connect(west[0], west[2], SOUTH, DOWN)
    draft.connect(west[1], west[2], NORTH, DOWN)
    draft.connect(west[0], near_post[1], NORTH, EAST)


def rough_rider(seed: int) -> Design:
    """Return a tray on four large wheels, each on its own spring leg."""
    begin = 1.0 + 0.1 * (seed % 5)
    draft = Draft(modules="workshop")
    rows = (*range(-_TRAY, _TRAY + 1), -_HALF_LENGTH, _HALF_LENGTH)
    deck = draft.grid(draft.start("under the cargo"), _HALF_LENGTH, _HALF_WIDTH, rows)
    for (x, y), block in deck.items():
        if abs(y) <= _TRAY and (abs(x) == _HALF_WIDTH or abs(y) == _TRAY):
            draft.attach(block, UP, note="rail")
    wheels = []
    for y in (_HALF_LENGTH, -_HALF_LENGTH):
        for x, side in ((_HALF_WIDTH, EAST), (-_HALF_WIDTH, WEST)):
            leg = draft.attach(deck[x, y], DOWN, "Suspension")
            wheels.append(draft.wheel(leg, side, "Large Wheel"))
    return one_part(
        draft,
        "rover",
        "A tray of 5 x 5 with rails, a spring leg and a wheel at each corner",
        overall="A railed tray on four large wheels, each sprung by itself.",
        control=keyed(
            "All wheels drive north.",
            [(wheel, "spinning_forward", "UpArrow") for wheel in wheels],
            [(begin, "UpArrow", 8.0)],
        ),
    )


DESIGNS: Final[Designs] = {
    "mechanisms-1": rough_rider,
    "mechanisms-7": loaded_lift,
}
