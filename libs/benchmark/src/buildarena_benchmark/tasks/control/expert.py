"""Machines that programs control: a car with two sides, a craft of four fans, a mast on an axle."""

# BuildArena benchmark data, not for training corpora:
# canary 3ab839c7-e533-462b-9729-71495c1ee1f6

from typing import Final

from buildarena_benchmark.experts.design import Design, Designs, one_part, sided_car
from buildarena_benchmark.experts.drafting import DOWN, EAST, NORTH, SOUTH, UP, WEST, Draft
from buildarena_benchmark.experts.programs import program_text, quoted
from buildarena_benchmark.tasks.control.walker import walker

_LENGTH, _TRACK = 3, 2
_ARM: Final = 2
_MAST: Final = 3
_FOOT, _TOES, _POST, _REACH = 5, 4, 4, 4
_GRAVITY: Final = 32.81
_FAN_PUSH: Final = 3.25
"""Push of a fan, in masses that it would hold up."""
_WOOD_MASS, _FAN_MASS = 0.3, 0.5


def gate_finder(seed: int) -> Design:
    """Return a short, wide car that turns by driving its sides apart, towards the next gate."""
    return _car("gates", keen=f"{1.0 + 0.02 * (seed % 5):g}")


def line_follower(seed: int) -> Design:
    """Return the same car; three ground sensors before it see the line."""
    return _car(
        "line",
        leads=True,
        speed=f"{0.7 + 0.01 * (seed % 5):g}",
        keen="0.4",
        near="0.4",
        learns="0.04",
    )


def sparing_lander(seed: int) -> Design:
    """Return the same craft, which falls fast and brakes late: it has little fuel."""
    return _craft("sparing", keen=f"{3 + 0.02 * (seed % 5):g}", damped="3.3")


def keeper(seed: int) -> Design:
    """Return the same craft, with the mark's waves built in, leaning against the wind."""
    return _craft("place", keen=f"{5 + 0.05 * (seed % 5):g}", damped="4")


def balancer(seed: int) -> Design:
    """Return a tall mast on two wheels on one axle, which run after its top: it falls slowly."""
    draft = Draft(modules="workshop")
    middle = draft.start("middle of the axle")
    sides = {}
    for name, way in (("right", EAST), ("left", WEST)):
        sides[name] = draft.wheel(draft.row(middle, way, _TRACK)[-1], way)
    top = middle
    for _ in range(_MAST):
        top = draft.attach(top, UP, "Log")
    return one_part(
        draft,
        "cart",
        f"An axle with two wheels, and {_MAST} logs above each other on it",
        overall="A mast on two powered wheels that stands because they run after its top.",
        program=program_text(
            __package__, "balance", **quoted(sides), keen=f"{0.44 + 0.01 * (seed % 5):g}"
        ),
    )


def placer(seed: int) -> Design:
    """Return an arm with shoulder and elbow above a wide foot, whose gripper two pistons lower."""
    draft = Draft(modules="workshop")
    middle = draft.start("under the post")
    for way in (NORTH, SOUTH):
        end = draft.row(middle, way, _FOOT)[-1]
        for side in (EAST, WEST):
            draft.row(end, side, _TOES)
    shoulder = draft.attach(draft.row(middle, UP, _POST)[-1], UP, "Steering Block")
    elbow = draft.attach(draft.row(shoulder, NORTH, _REACH)[-1], UP, "Steering Block")
    upper = draft.attach(draft.row(elbow, NORTH, _REACH)[-1], DOWN, "Piston")
    lower = draft.attach(upper, DOWN, "Piston")
    gripper = draft.attach(lower, DOWN, "Grabber")
    named = {"shoulder": shoulder, "elbow": elbow, "upper": upper, "lower": lower}
    return one_part(
        draft,
        "arm",
        f"A foot like an H, a post of {_POST}, two arms of {_REACH}, a gripper",
        overall="An arm with shoulder and elbow, above a foot; two pistons lower its gripper.",
        program=program_text(
            __package__,
            "placing",
            **quoted(named | {"gripper": gripper}),
            arm=f"{_REACH}",
            forearm=f"{_REACH}",
            looks=f"{1 + 0.04 * (seed % 5):g}",
            down="1.37",
            keen="4",
        ),
    )


def _car(program: str, *, leads: bool = False, **figures: str) -> Design:
    """Return a car of two sides, and the program that drives it.

    Args:
        leads: Whether the starting block is in front, and not in the middle.
    """
    draft = Draft(modules="workshop")
    start = draft.start("front of the spine" if leads else "middle of the spine")
    front = start if leads else draft.row(start, NORTH, _LENGTH // 2)[-1]
    back = draft.row(start, SOUTH, _LENGTH - 1 if leads else _LENGTH // 2)[-1]
    sides: dict[str, list[str]] = {"left": [], "right": []}
    for base in (front, back):
        for way, name in ((EAST, "right"), (WEST, "left")):
            sides[name].append(draft.wheel(draft.row(base, way, _TRACK)[-1], way))
    return sided_car(draft, sides, __package__, program, **figures)


def _craft(program: str, **figures: str) -> Design:
    """Return a cross with a fan at the end of each arm, and the program that flies it."""
    draft = Draft(modules="workshop")
    middle = draft.start("middle of the cross")
    fans = {}
    for name, way in (("north", NORTH), ("east", EAST), ("south", SOUTH), ("west", WEST)):
        fans[name] = draft.attach(draft.row(middle, way, _ARM)[-1], UP, "Flying Block")
    # Turned about a level axis: two fans, two arms of wood, and a little for what has a size.
    inertia = 2 * _FAN_MASS * _ARM**2 + 2 * _WOOD_MASS * sum(k * k for k in range(1, _ARM + 1)) + 1
    return one_part(
        draft,
        "craft",
        f"Four arms of {_ARM} blocks, a fan on each end that pushes up",
        overall="A cross with a fan at the end of each arm, which flies by how they differ.",
        program=program_text(
            __package__,
            "flying",
            **quoted(fans),
            arm=f"{_ARM}",
            mass=f"{float(draft.machine.mass):g}",
            inertia=f"{inertia:g}",
            push=f"{_FAN_PUSH * _GRAVITY:g}",
            gravity=f"{_GRAVITY:g}",
        )
        + program_text(__package__, program, **figures),
    )


DESIGNS: Final[Designs] = {
    "landing-2": sparing_lander,
    "slalom-2": gate_finder,
    "hover-4": keeper,
    "balance-2": balancer,
    "walk-1": walker,
    "place-2": placer,
    "line-1": line_follower,
}
