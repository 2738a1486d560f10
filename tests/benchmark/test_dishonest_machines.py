"""Machines that balance, walk, land or follow a line in ways that must not count."""

from collections.abc import Callable
from typing import Final

import pytest
from support.machines.building import KeyedDraft
from support.machines.piloted import scored
from tests.benchmark.conftest import expert, strict

from buildarena_benchmark import builtin_tasks, score
from buildarena_benchmark.experts.drafting import DOWN, EAST, NORTH, SOUTH, UP, WEST
from buildarena_geometry import Machine
from buildarena_simulation import simulate
from buildarena_simulation.scenario import Push

TASKS: Final = builtin_tasks()
IDLE: Final = "function control() return {} end"


def moved_by(draft: KeyedDraft, answer: str) -> Machine:
    return draft.machine.with_controller(f"function control(t, sense) return {{ {answer} }} end")


def workshop() -> tuple[KeyedDraft, str]:
    draft = KeyedDraft(modules="workshop")
    return draft, draft.start()


# Standing on two wheels


def cart(*, logs: int = 3, wheel: str = "Powered Wheel") -> KeyedDraft:
    """A mast on an axle; block 1 is in the axle's middle, the last one is the mast's top."""
    draft, middle = workshop()
    for way in (EAST, WEST):
        draft.wheel(draft.row(middle, way, 1)[-1], way, wheel)
    for _ in range(logs):
        middle = draft.attach(middle, UP, "Log")
    return draft


def short() -> KeyedDraft:
    """Hangs under its axle: large wheels, and what is heavy low between them."""
    draft = cart(logs=0, wheel="Large Wheel")
    draft.attach("1", DOWN, "Ballast")
    return draft


def third_wheel() -> KeyedDraft:
    draft = cart()
    draft.wheel(draft.row("1", NORTH, 3)[-1], EAST)
    return draft


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("build", "flags"),
    [
        (cart, ()),
        (short, ("propped",)),
        (third_wheel, ("not_on_two_wheels",)),
    ],
)
def test_who_does_nothing_does_not_balance(build, flags, engine) -> None:
    result = scored(TASKS["balance-2"], build().machine.with_controller(IDLE), engine, None)
    assert not result.success, result
    assert result.indicator < 0.6
    assert result.flags == flags
    assert result.indicator == 0 or not flags


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("share", ["1", "t % 0.4 < 0.2 and 1 or -1"])
def test_driving_on_and_shaking_do_not_balance(engine, share) -> None:
    machine = moved_by(cart(), f"spinning_forward = {share}")
    assert not scored(TASKS["balance-2"], machine, engine, 1).success


@pytest.mark.nightly
def test_spinning_in_place_does_not_balance(engine) -> None:
    """A long bar above the wheels, which turns about the vertical: that may keep it level."""
    draft = cart(logs=1, wheel="Large Wheel")
    top = list(draft.machine.blocks)[-1]
    for way in (NORTH, SOUTH):
        draft.attach(draft.attach(draft.attach(top, way, "Log"), way, "Log"), way, "Log")
    share = "math.min(1, t / 2)"
    spins = f'["3.spinning_forward"] = {share}, ["5.spinning_forward"] = -{share}'
    result = scored(TASKS["balance-2"], moved_by(draft, spins), engine, None)
    assert (result.success, result.indicator < 0.2) == (False, True)


# Walking

WALK: Final = TASKS["walk-1"]
LEVEL: Final = WALK.scenario.model_copy(
    update={"placement": TASKS["balance-2"].scenario.placement, "terrain": (), "randomization": {}}
)
"""The same trial on flat ground, facing north: what fails there fails by its rule."""


def chain(draft: KeyedDraft, base: str, way: object, count: int) -> list[str]:
    made = []
    for _ in range(count):
        base = draft.attach(base, way, "Piston")
        made.append(base)
    return made


def telescope() -> Machine:
    """Stands still on a wide base, and pushes its starting block ten units north."""
    draft, start = workshop()
    base = draft.row(chain(draft, start, SOUTH, 10)[-1], SOUTH, 3)[-1]
    for way in (EAST, WEST):
        draft.row(base, way, 4)
    return moved_by(draft, "extend = 1")


def mast() -> Machine:
    """Stands on a narrow foot, its starting block on the top, and falls northwards."""
    draft, base = workshop()
    for _ in range(4):
        base = draft.attach(base, DOWN, "Log")
    hinge = draft.attach(base, DOWN, "Steering Hinge")
    draft.turn_axis(hinge, 0, WEST)
    foot = draft.attach(hinge, DOWN)
    for way in (EAST, WEST):
        draft.row(foot, way, 1)
    return moved_by(draft, "turn_right = 1")


def sled() -> Machine:
    """A flat board with a hinge, so that it has two links."""
    draft, start = workshop()
    for way in (EAST, WEST, NORTH):
        draft.row(start, way, 2)
    hinge = draft.attach(start, SOUTH, "Steering Hinge")
    draft.turn_axis(hinge, 0, UP)
    draft.attach(hinge, SOUTH)
    return moved_by(draft, "")


def stepper() -> Machine:
    """The expert's machine, which lifts its feet in turn, and does not move ahead."""
    lifts = '["7.extend"] = t % 3 < 1.5 and 1 or 0, ["8.extend"] = t % 3 < 1.5 and 1 or 0'
    return expert("walk-1").with_controller(f"function control(t, sense) return {{ {lifts} }} end")


@pytest.mark.nightly
@pytest.mark.parametrize("build", [telescope, mast, sled, stepper])
def test_what_does_not_walk_does_not_pass(build, engine) -> None:
    machine = build()
    trial = simulate(machine, LEVEL, engine)
    result = score(WALK, machine, trial)
    assert not result.success, result
    assert result.indicator < 1, result
    # The starting blocks of these get far enough all the same.
    came = float((trial.positions[:, 0, 1] - trial.positions[0, 0, 1]).max())
    assert (came > WALK.scoring.min_distance) == (build in {telescope, mast})
    assert ("not_walked" in result.flags) == (build in {telescope, mast})


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("build", [sled, stepper])
def test_who_is_pushed_and_slides_does_not_walk(build, engine) -> None:
    """Even where its feet are lifted in turn meanwhile: a link that slides carries nothing."""
    pushes = tuple(Push(at_s=1 + 1.5 * k, velocity=(0, 12)) for k in range(12))
    machine = build()
    trial = simulate(machine, LEVEL.model_copy(update={"pushes": pushes}), engine)
    result = score(WALK, machine, trial)
    assert float(trial.positions[:, 0, 1].max()) > 8
    assert (result.success, result.indicator < 3) == (False, True), result


# Landing and keeping a place

FAN = "Flying Block"


def cross() -> KeyedDraft:
    """A cross with a fan on each arm, all on one key."""
    draft, middle = workshop()
    for way in (NORTH, EAST, SOUTH, WEST):
        draft.bind(draft.attach(draft.row(middle, way, 2)[-1], UP, FAN), "fly", "Alpha1")
    return draft


@pytest.mark.nightly
def test_a_tower_at_the_place_is_no_flight(engine) -> None:
    """The place is reached from the ground: a mast, and the mass at its top."""
    draft, middle = workshop()
    top = draft.row(middle, UP, 13)[-1]
    for way in (NORTH, EAST, SOUTH, WEST):
        draft.row(middle, way, 4)
        for block in draft.row(top, way, 2):
            draft.attach(block, UP, "Ballast")
    machine = draft.machine.with_controller(IDLE)
    for task in (TASKS["hover-4"], strict(TASKS["hover-4"], radius=12.0)):
        result = scored(task, machine, engine, None)
        assert (result.success, result.indicator) == (False, 0.0)


# Following a line


def blind(left: float, right: float) -> Machine:
    """The expert's car, whose sides are driven alike all the time."""
    machine = expert("line-1")
    begin = machine.controller.index("local LEFT")
    sides = machine.controller[begin : machine.controller.index("\n", begin)]
    loops = "".join(
        f'for _, w in ipairs({side}) do answer[w .. ".spinning_forward"] = {share} end\n'
        for side, share in (("LEFT", left), ("RIGHT", right))
    )
    program = f"{sides}\nfunction control()\nlocal answer = {{}}\n{loops}return answer end"
    return machine.with_controller(program)


def turning_bar() -> Machine:
    """Wheels at the ends of a long bar run along the line's whole length; its middle stays."""
    draft, start = workshop()
    end = start
    for _ in range(7):
        end = draft.attach(end, EAST, "Log")
    asked = []
    for base, way, share in ((start, WEST, 0.8), (draft.attach(end, EAST), EAST, -0.8)):
        for side in (NORTH, SOUTH):
            wheel = draft.wheel(draft.row(base, side, 2)[-1], way)
            asked.append(f'["{wheel}.spinning_forward"] = {share}')
    return moved_by(draft, ", ".join(asked))


def fan_car() -> Machine:
    """A car whose wheels only roll, and that a fan pushes."""
    draft, start = workshop()
    back = draft.row(start, SOUTH, 3)[-1]
    for base in (start, back):
        for way in (EAST, WEST):
            draft.attach(draft.attach(base, way), way, "Wheel Unpowered")
    draft.attach(back, SOUTH, FAN)
    return moved_by(draft, "fly = 1")


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("build", "most"),
    [
        (lambda: blind(0.6, 0.6), 3),
        (lambda: blind(-0.6, -0.6), 0),
        (turning_bar, 0),
        (fan_car, 0),
    ],
    ids=["straight on", "backwards", "turning bar", "fan"],
)
def test_what_does_not_look_follows_no_line(build: Callable[[], Machine], most, engine) -> None:
    result = scored(TASKS["line-1"], build(), engine, None)
    assert not result.success, result
    assert result.metrics["stretches"] <= most
