"""Mechanisms: what counts, and what does not. Trajectories made by hand."""

import json
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from support.machines.building import KeyedDraft
from tests.benchmark.conftest import (
    Path,
    make_trajectory,
    rolled,
    shifted,
    strict,
    wheels_of,
    with_bearing,
    with_pieces,
)

from buildarena_benchmark import Score, Task, score
from buildarena_benchmark.experts.drafting import EAST, NORTH, UP, WEST, Draft
from buildarena_geometry import Machine
from buildarena_simulation import Event, Trajectory


def only_wheels(machine: Machine, trial: Trajectory, **forces: object) -> Trajectory:
    return with_bearing(trial, wheels=1.0, wheel_ids=wheels_of(machine), **forces)


def ramp(t: np.ndarray, begin: float, end: float) -> np.ndarray:
    """0 before, 1 after, and evenly in between."""
    return np.clip((t - begin) / (end - begin), 0.0, 1.0)


# Rough road


def ride(
    car: Machine,
    *,
    speed: float = 2.0,
    spin: float | None = None,
    aside: float = 0.0,
    shake: float = 0.0,
    lost_s: float | None = None,
    support: object = 10.0,
    begin_s: float = 1.0,
) -> Trajectory:
    """A ride northwards at a speed from a time on, its cargo shaken by an amplitude at 2 Hz."""

    def moved(t: np.ndarray) -> np.ndarray:
        way = speed * np.maximum(t - begin_s, 0.0)
        return np.column_stack([aside * way, way, np.zeros_like(t)])

    def cargo(t: np.ndarray) -> np.ndarray:
        kept = moved(t if lost_s is None else np.minimum(t, lost_s))
        height = 2.0 + shake * np.sin(4 * np.pi * t) * (t > begin_s)
        return kept + np.outer(height, [0, 0, 1])

    trial = make_trajectory(
        car, 30.0, moved=moved, cargo=cargo, cargo_mass=lambda t: np.full_like(t, 10.0)
    )
    turn = speed if spin is None else spin
    trial = rolled(car, trial, lambda t: turn * np.maximum(t - begin_s, 0.0))
    return only_wheels(car, trial, cargo=support)


def test_a_ride_is_worth_less_the_more_it_shakes(tasks, car) -> None:
    # (4 pi)^2 A / sqrt(2) of 32.81: one g at 0.294
    hopping = np.where(np.arange(751) % 20 < 8, 25.0, 0.0)
    for how, rms, success in (
        ({}, 0.0, True),
        ({"support": hopping}, 0.0, True),  # a cargo that hops on its deck is kept
        ({"shake": 0.2}, 0.68, True),
        ({"shake": 0.2, "begin_s": 13.0}, 0.68, None),  # waiting makes no ride gentler
        ({"shake": 0.35}, 1.19, False),
    ):
        result = score(tasks["mechanisms-1"], car, ride(car, **how))
        assert result.metrics["rms_acceleration"] == pytest.approx(rms, rel=0.05, abs=0.02)
        if success is not None:
            assert result.success == success
            assert result.indicator == pytest.approx(36.0 / (1 + rms), rel=0.03)


def test_what_is_no_ride_over_the_road(tasks, car, subtests) -> None:
    for name, how, most, flags in (
        ("thrown, or pushed by cannons", {"spin": 0.0}, 0.6, ("not_driven",)),
        ("wheels turn the other way", {"spin": -2.0}, 0.6, ("not_driven",)),
        ("the cargo fell off", {"lost_s": 5.0}, 9.6, ("not_carried",)),
        ("pushed along, or thrown", {"support": 0.0}, 2.1, ("not_carried",)),
        ("dragged along the ground", {"support": 4.0}, 2.1, ("not_carried",)),
        ("left the road after 15 / 0.6", {"aside": 0.6}, 25.1, ()),
        ("no ridges southwards", {"speed": -2.0, "spin": -2.0}, 0.0, ()),
        ("too slow", {"speed": 1.0}, 29.1, ()),
    ):
        with subtests.test(name=name):
            result = score(tasks["mechanisms-1"], car, ride(car, **how))
            assert (result.success, result.flags) == (False, flags)
            assert result.indicator <= most


def test_a_vehicle_that_topples_forward_has_not_driven(tasks, car) -> None:
    trial = ride(car, spin=0.0, begin_s=20.0, speed=32.0)
    positions = trial.positions.copy()
    positions[:, 3:] = positions[0, 3:]  # most of it stays behind
    result = score(tasks["mechanisms-1"], car, replace(trial, positions=positions))
    assert (result.success, result.indicator < 5) == (False, True)


# Slalom

GATES = [(4.0, 10.0), (-4.0, 20.0), (4.0, 30.0), (-4.0, 40.0), (4.0, 50.0)]
BEYOND = [*GATES, (4.0, 55.0)]


def drive(
    car: Machine, through: list[tuple[float, float]], *, speed: float = 4.0, driven: bool = True
) -> Trajectory:
    """A drive along straight lines through points, its wheels turned as far as it goes."""
    points = np.array([(0.0, 0.0), *through])
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])

    def moved(t: np.ndarray) -> np.ndarray:
        along = np.minimum(speed * t, lengths[-1])
        at = [np.interp(along, lengths, points[:, k]) for k in (0, 1)]
        return np.column_stack([*at, np.zeros_like(t)])

    trial = make_trajectory(car, 30.0, moved=moved)
    north = np.diff(moved(trial.time_s)[:, 1], prepend=0.0)
    trial = rolled(car, trial, lambda t: np.cumsum(north) * 1.6 if driven else np.zeros_like(t))
    return only_wheels(car, trial)


def test_which_gates_count(tasks, car, subtests) -> None:
    for through, gates in (
        (BEYOND, 5),
        ([*GATES[:4], (0.0, 60.0)], 4),  # one is missed
        ([GATES[0], *GATES[2:], (4.0, 55.0)], 4),  # one is left out
        ([(0.0, 60.0)], 0),  # straight on
        ([(4.0, 60.0)], 1),
        ([(x - 1.6, y) for x, y in GATES], 0),  # next to every gate
        ([(x + 1.4, y) for x, y in GATES[:4]] + [(0, 60)], 4),
        ([(20, 5), (20, 60), (4, 60), *GATES[::-1], (0, 0)], 0),  # backwards
        ([(4, 9), (4, 11)] * 4, 1),  # to and fro
        ([(-4, 15), (-4, 22), (9, 22), (9, 5), *GATES[:1], (4, 12)], 1),  # out of order
        ([(4, 9), (4, 10)], 1),
    ):
        with subtests.test(through=through):
            result = score(tasks["five-gates"], car, drive(car, through))
            assert result.metrics["gates"] == gates
            assert result.success == (gates >= 4)
            assert (result.indicator > 0) == (gates > 0)
            assert result.indicator <= gates / 5


def test_faster_is_worth_more_and_what_is_not_driven_nothing(tasks, car, engine_machine) -> None:
    def slalom(trial: Trajectory, machine: Machine = car) -> Score:
        return score(tasks["five-gates"], machine, trial)

    for speed in (3.0, 6.0):  # the gates are 36.4 from the start on average
        indicator = slalom(drive(car, BEYOND, speed=speed)).indicator
        assert indicator == pytest.approx(1 - 36.4 / speed / 30, abs=0.01)
    whole = slalom(drive(car, GATES))
    since_s = float(whole.metrics["last_gate_s"]) / 2
    torn = slalom(with_pieces(drive(car, GATES), wheels_of(car)[:1], since_s=since_s))
    assert 0 < torn.metrics["gates"] < 4
    assert (torn.success, torn.metrics["wheels_lost"]) == (False, True)
    thrown = slalom(drive(car, GATES, driven=False))
    assert (thrown.success, thrown.indicator, thrown.flags) == (False, 0.0, ("not_driven",))
    north = np.linspace(0, 60, 751)
    way = [np.interp(north, [y for _, y in GATES], [x for x, _ in GATES]), north, 0 * north]
    trial = make_trajectory(engine_machine, 30.0, heated=[False, False])
    trial = with_bearing(shifted(trial, np.column_stack(way)))
    assert slalom(trial, engine_machine).indicator == 0.0, "it has no wheels"


def test_a_gate_that_half_a_car_passed_does_not_count(tasks, car) -> None:
    """The starting block may be next to a gate; wheels and mass may not, one wheel by the task."""
    trial, wheels = drive(car, BEYOND), wheels_of(car)
    astride = shifted(shifted(trial, [-3, 0, 0], wheels[0]), [3, 0, 0], wheels[2])
    for task, gates in (
        (tasks["five-gates"], 5),
        (strict(tasks["five-gates"], keeps_within=True), 0),
    ):
        assert score(task, car, astride).metrics["gates"] == gates
    for blocks, gates in (
        (["1"], 5),
        (wheels, 0),
        (["3", "4", *wheels], 0),  # all but the starting block
    ):
        result = score(tasks["five-gates"], car, shifted(trial, [-3, 0, 0], *blocks))
        assert result.metrics["gates"] == gates, blocks
    body = [block for block in car.blocks if block not in wheels]
    share = 3.0 * sum(car.blocks[block].module.mass for block in body) / float(car.mass)
    loaded = score(tasks["five-gates"], car, shifted(trial, [-3, 0, 0], *body))
    assert (loaded.metrics["gates"] == 5) == (share <= 1.5)
    whole, behind = (  # a gate is passed when the last of the car has passed it
        score(tasks["five-gates"], car, shifted(trial, [0, -late, 0], *wheels)).metrics
        for late in (0.0, 1.0)
    )
    late_s = behind["last_gate_s"] - whole["last_gate_s"]
    assert late_s == pytest.approx(1.0 / (4.0 * 0.78), abs=0.1)


# Winch

POWERED, MEDIUM, LARGE = "Cog Medium Powered", "Cog Medium Unpowered", "Cog Large Unpowered"


def gear_train(*cogs: str, apart: int = 3, pivot: str = LARGE) -> Draft:
    """A bar whose first block carries an arm on a pivot; a driven cog on its last.

    The arm's end is the last block, and what holds the cargo.

    Args:
        cogs: Between pivot and driven cog, each with how far its axis is from the bar's start.
        apart: How far the driven cog's axis is.
        pivot: What the arm turns on.
    """
    draft = KeyedDraft(modules="workshop")
    start = draft.start()
    bar = [start, *draft.row(start, EAST, max(apart, 7))]
    for place, cog in enumerate(cogs):
        draft.attach(bar[3 + 2 * place], NORTH, cog)
    motor = draft.attach(bar[apart], NORTH, POWERED)
    arm = draft.attach(draft.attach(start, NORTH, pivot), NORTH)
    draft.row(arm, WEST, 3)
    draft.bind(motor, "spinning_forward", "UpArrow")
    draft.press("UpArrow", 1.0, 20.0)
    return draft


def rises(t: np.ndarray) -> np.ndarray:
    return 6.0 * ramp(t, 2.0, 15.0)


def turns(t: np.ndarray) -> np.ndarray:
    return 60.0 * ramp(t, 2.0, 15.0)


def lift(
    machine: Machine,
    *,
    rise: Path = rises,
    support: float = 20.0,
    ground: object = None,
    turn: Path = turns,
) -> Trajectory:
    """A cargo that rises while all large cogs turn about the north."""

    def cargo(t: np.ndarray) -> np.ndarray:
        return np.column_stack([np.zeros_like(t), np.full_like(t, 6.0), 0.5 + rise(t) * (t > 0)])

    trial = make_trajectory(machine, 30.0, cargo=cargo, cargo_mass=lambda t: np.full_like(t, 20.0))
    half = np.radians(turn(trial.time_s)) / 2
    quaternions = trial.quaternions.copy()
    for column, block in enumerate(trial.block_ids):
        if machine.blocks[block].module.name == LARGE:
            quaternions[:, column] = np.outer(np.cos(half), [1, 0, 0, 0])
            quaternions[:, column, 2] = np.sin(half)
    held = Event(time_s=0.0, what="grabbed", joint=list(machine.blocks)[-1], held="cargo")
    trial = replace(trial, quaternions=quaternions, events=(held,))
    weight = float(machine.mass) + support if ground is None else ground
    return with_bearing(trial, cargo=support, ground=weight)


@pytest.fixture(scope="module")
def train() -> Machine:
    return gear_train().machine


def hauled(tasks: dict[str, Task], machine: Machine, **how: object) -> Score:
    return score(tasks["mechanisms-7"], machine, lift(machine, **how))  # type: ignore[arg-type]


def test_who_holds_it(tasks, train, subtests) -> None:
    before = partial(ramp, begin=0.0, end=0.9)
    for name, how, flag in (
        ("thrown, or lies on a terrain", {"support": 0.0}, "not_carried"),
        ("balloons or fans hold it", {"ground": 0.0}, "not_standing"),
        ("in part", {"ground": 10.0}, "not_standing"),
        ("turns too little", {"turn": lambda t: 19.0 * ramp(t, 2.0, 15.0)}, "not_geared"),
        ("before the key", {"turn": lambda t: 60.0 * before(t)}, "not_geared"),
        ("once it is up", {"turn": lambda t: 60.0 * ramp(t, 15.5, 19.0)}, "not_geared"),
        ("up before", {"rise": lambda t: 0.61 * ramp(t, 0, 0.5) + rises(t)}, "not_geared"),
    ):
        with subtests.test(name=name):
            result = hauled(tasks, train, **how)
            assert (result.success, result.indicator, result.flags) == (False, 0.0, (flag,))
    trial = with_pieces(lift(train), list(train.blocks)[1:3], since_s=12.0)
    result = score(tasks["mechanisms-7"], train, trial)
    assert (result.success, result.flags) == (False, ("came_apart",))


def test_what_the_gears_must_be(tasks) -> None:
    for draft, counts in (
        (gear_train(MEDIUM, apart=5), True),  # by another cog
        (gear_train(MEDIUM, MEDIUM, apart=7), True),
        (gear_train(apart=4), False),  # in no mesh
        (gear_train(MEDIUM, apart=6), False),
        (gear_train(pivot=MEDIUM, apart=2), False),  # no large one
        (gear_train(pivot="Swivel"), False),
    ):
        assert hauled(tasks, draft.machine).success == counts
    draft = gear_train()
    base = draft.attach("8", UP)
    assert hauled(tasks, draft.machine).flags == ("not_geared",), "the base holds the cargo"
    draft.connect(base, "13", UP, connector="Winch")
    assert hauled(tasks, draft.machine).flags == ("not_geared",), "a rope goes round the axle"


def test_the_keys_that_were_played_decide(tasks, train) -> None:
    machine = train.copy()
    assert machine.act("remove_control_sequence", {"index": 0}).ok
    assert hauled(tasks, machine).flags == ("not_geared", "unstable"), "the energy is from nowhere"
    for key, flags in (("UpArrow", ()), ("Alpha1", ("not_geared", "unstable"))):
        played = replace(lift(train), settings={"presses": json.dumps([[key, 1.0, 12.0]])})
        assert score(tasks["mechanisms-7"], train, played).flags == flags


# Pick and place


def _held(t: np.ndarray) -> np.ndarray:
    return np.where((t > 2) & (t < 12), 2.0, 0.0)


def carry(
    machine: Machine,
    *,
    top: float = 4.0,
    end: tuple[float, float] = (4.0, 3.0),
    around: float = 0.0,
    support: Path = _held,
    base: Path | None = None,
    shiver: float = 0.0,
) -> Trajectory:
    """A cargo lifted, carried over and put down from 2 to 12 s."""

    def cargo(t: np.ndarray) -> np.ndarray:
        over = ramp(t, 5.0, 9.0)
        up = ramp(t, 2.2, 5.0) - ramp(t, 9.0, 11.8)
        east = -4.0 + (end[0] + 4.0) * over + shiver * (t > 15) * np.sin(20 * t)
        north = 3.0 + (end[1] - 3.0) * over + around * np.sin(np.pi * over)
        return np.column_stack([east, north, 0.5 + top * up])

    trial = make_trajectory(
        machine, 30.0, moved=base, cargo=cargo, cargo_mass=lambda t: np.full_like(t, 2.0)
    )
    return with_bearing(replace(trial, cargo_size=(1.0, 1.0, 1.0)), cargo=support(trial.time_s))


def test_what_is_carried(tasks, car, subtests) -> None:
    def throws(t: np.ndarray) -> np.ndarray:
        return np.where((t > 2) & (t < 5.5), 2.0, 0.0)

    for name, how, flags, indicator in (
        ("exactly", {}, None, 1.0),
        ("nearly", {"end": (4.0, 3.5)}, None, 1 / 1.5),
        ("hardly", {"end": (3.2, 3.0)}, None, 1 / 1.8),
        ("too far from the mark", {"end": (4.0, 4.1)}, (), 1 / 2.1),
        ("kicked", {"support": np.zeros_like}, ("not_carried",), 0.0),
        ("thrown", {"support": throws}, ("not_carried",), 0.0),
        (
            "let go on the way",
            {"support": lambda t: _held(t) * (abs(t - 8.3) > 0.7)},
            ("not_carried",),
            0,
        ),
        ("through the wall's end", {"top": 1.5}, ("not_carried",), 0.0),
        ("pushed round it", {"top": 0.0, "around": 9.0}, ("not_carried",), 0.0),
        ("never put down", {"support": lambda t: np.where(t > 2, 2.0, 0.0)}, (), 1.0),
        ("does not come to rest", {"shiver": 0.2}, (), None),
        ("goes", {"base": lambda t: np.outer(ramp(t, 3, 9), [0.6, 0, 0])}, ("base_moved",), 0.0),
        ("sways", {"base": lambda t: np.outer(np.sin(t), [0, 0.51, 0])}, ("base_moved",), 0.0),
        ("goes a little", {"base": lambda t: np.outer(ramp(t, 3, 9), [0.4, 0, 0])}, None, 1.0),
    ):
        with subtests.test(name=name):
            result = score(tasks["over-a-wall"], car, carry(car, **how))
            assert (result.success, result.flags) == (flags is None, flags or ())
            if indicator is not None:
                assert result.indicator == pytest.approx(indicator, rel=1e-3)
    rests = strict(tasks["over-a-wall"], must_rest=True)
    held = carry(car, support=lambda t: np.where(t > 2, 2.0, 0.0))
    assert score(rests, car, held).indicator == 0, "never put down"
    apart = with_pieces(carry(car), list(car.blocks)[-2:], since_s=8.0)
    result = score(tasks["over-a-wall"], car, apart)
    assert (result.success, result.indicator, result.flags) == (False, 0.0, ("came_apart",))
    result = score(tasks["over-a-wall"], car, carry(car, end=(-4.0, 3.0), top=0.0))
    assert (result.success, result.indicator) == (False, 0.0), "no part touched it"


def test_without_forces_nothing_can_be_judged(tasks, car, train) -> None:
    trials = (ride(car), drive(car, GATES), lift(train), carry(car))
    names = ("mechanisms-1", "five-gates", "mechanisms-7", "over-a-wall")
    for name, machine, trial in zip(names, (car, car, train, car), trials, strict=True):
        result = score(tasks[name], machine, replace(trial, bearing=None))
        assert (result.success, result.indicator) == (False, 0.0)
        assert result.flags == ("forces_not_measured",)
