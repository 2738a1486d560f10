"""Mechanisms: what counts, and what does not. Trajectories made by hand."""

import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from support.machines.drafts import KeyedDraft
from tests.benchmark.conftest import make_trajectory, rolled, wheels_of, with_bearing, with_pieces

from buildarena_benchmark import Score, Task, score
from buildarena_geometry import Machine
from buildarena_simulation import Event, Trajectory
from buildarena_worker.builtin.designs.drafting import DOWN, EAST, NORTH, SOUTH, UP, WEST, Draft

Path = Callable[[np.ndarray], np.ndarray]


def only_wheels(machine: Machine, trial: Trajectory, **forces: object) -> Trajectory:
    return with_bearing(trial, **{"wheels": 1.0, "wheel_ids": wheels_of(machine), **forces})


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
    borne: object = 10.0,
    begin_s: float = 1.0,
) -> Trajectory:
    """A ride northwards at a speed from a time on, its cargo shaken by an amplitude at 2 Hz."""

    def moved(t: np.ndarray) -> np.ndarray:
        way = speed * np.maximum(t - begin_s, 0.0)
        return np.column_stack([aside * way, way, np.zeros_like(t)])

    def cargo(t: np.ndarray) -> np.ndarray:
        kept = moved(t if lost_s is None else np.minimum(t, lost_s))
        height = 2.0 + shake * np.sin(4 * np.pi * t) * (t > begin_s)
        return kept + np.column_stack([np.zeros_like(t), np.zeros_like(t), height])

    trial = make_trajectory(
        car, 30.0, moved=moved, cargo=cargo, cargo_mass=lambda t: np.full_like(t, 10.0)
    )
    turn = speed if spin is None else spin
    trial = rolled(car, trial, lambda t: turn * np.maximum(t - begin_s, 0.0))
    return only_wheels(car, trial, cargo=borne)


def road(tasks: dict[str, Task], car: Machine, **how: object) -> Score:
    return score(tasks["mechanisms-1"], car, ride(car, **how))  # type: ignore[arg-type]


def test_a_quiet_ride_counts_in_full(tasks, car) -> None:
    result = road(tasks, car)
    assert result.success
    assert result.indicator == pytest.approx(36.0, abs=0.1)
    assert result.metrics["rms_acceleration"] == pytest.approx(0.0, abs=0.02)


def test_a_ride_is_worth_less_the_more_it_shakes(tasks, car) -> None:
    # (4 pi)^2 A / sqrt(2) of 32.81: one g at 0.294
    gentle, rough = road(tasks, car, shake=0.2), road(tasks, car, shake=0.35)
    assert gentle.metrics["rms_acceleration"] == pytest.approx(0.68, rel=0.03)
    assert gentle.success
    assert gentle.indicator == pytest.approx(36.0 / 1.68, rel=0.03)
    assert rough.metrics["rms_acceleration"] == pytest.approx(1.19, rel=0.03)
    assert not rough.success


def test_waiting_makes_no_ride_gentler(tasks, car) -> None:
    at_once, late = road(tasks, car, shake=0.2), road(tasks, car, shake=0.2, begin_s=13.0)
    gentle = at_once.metrics["rms_acceleration"]
    assert late.metrics["rms_acceleration"] == pytest.approx(gentle, rel=0.05)


@pytest.mark.parametrize(
    ("how", "most", "flags"),
    [
        ({"spin": 0.0}, 0.6, ("not_driven",)),  # thrown, or pushed by cannons
        ({"spin": -2.0}, 0.6, ("not_driven",)),  # wheels that turn the other way
        ({"lost_s": 5.0}, 9.6, ("not_carried",)),  # the cargo fell off
        ({"borne": 0.0}, 2.1, ("not_carried",)),  # pushed along, or thrown
        ({"borne": 4.0}, 2.1, ("not_carried",)),  # dragged along the ground
        ({"aside": 0.6}, 25.1, ()),  # left the road after 15 / 0.6
        ({"speed": -2.0, "spin": -2.0}, 0.0, ()),  # southwards there are no ridges
        ({"speed": 1.0}, 29.1, ()),
    ],
)
def test_what_is_no_ride_over_the_road(tasks, car, how, most, flags) -> None:
    result = road(tasks, car, **how)
    assert not result.success
    assert result.indicator <= most
    assert result.flags == flags


def test_a_cargo_that_hops_on_its_deck_is_kept(tasks, car) -> None:
    hopping = np.where(np.arange(751) % 20 < 8, 25.0, 0.0)
    assert road(tasks, car, borne=hopping).success


def test_a_vehicle_that_topples_forward_has_not_driven(tasks, car) -> None:
    trial = ride(car, spin=0.0, begin_s=20.0, speed=32.0)
    positions = trial.positions.copy()
    positions[:, 3:] = positions[0, 3:]  # most of it stays behind
    result = score(tasks["mechanisms-1"], car, replace(trial, positions=positions))
    assert not result.success
    assert result.indicator < 5


# Slalom

GATES = [(4.0, 10.0), (-4.0, 20.0), (4.0, 30.0), (-4.0, 40.0), (4.0, 50.0)]


def drive(
    car: Machine,
    through: list[tuple[float, float]],
    *,
    speed: float = 4.0,
    driven: bool = True,
    torn_s: float | None = None,
) -> Trajectory:
    """A drive along straight lines through points, its wheels turned as far as it goes."""
    points = np.array([(0.0, 0.0), *through])
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])

    def along(t: np.ndarray) -> np.ndarray:
        return np.minimum(speed * t, lengths[-1])

    def moved(t: np.ndarray) -> np.ndarray:
        at = [np.interp(along(t), lengths, points[:, k]) for k in (0, 1)]
        return np.column_stack([*at, np.zeros_like(t)])

    trial = make_trajectory(car, 30.0, moved=moved)
    north = np.diff(moved(trial.time_s)[:, 1], prepend=0.0)
    trial = rolled(car, trial, lambda t: np.cumsum(north) * 1.6 if driven else np.zeros_like(t))
    if torn_s is not None:
        trial = with_pieces(trial, wheels_of(car)[:1], since_s=torn_s)
    return only_wheels(car, trial)


def slalom(tasks: dict[str, Task], car: Machine, through: object, **how: object) -> Score:
    return score(tasks["mechanisms-2"], car, drive(car, through, **how))  # type: ignore[arg-type]


def test_a_slalom_through_all_gates(tasks, car) -> None:
    beyond = [*GATES, (4.0, 55.0)]
    slow, fast = slalom(tasks, car, beyond, speed=3.0), slalom(tasks, car, beyond, speed=6.0)
    assert slow.success
    assert fast.success
    assert slow.metrics["gates"] == fast.metrics["gates"] == 5
    assert 5 < slow.indicator < fast.indicator < 6


@pytest.mark.parametrize(
    ("through", "gates"),
    [
        ([*GATES[:4], (0.0, 60.0)], 4),  # one is missed
        ([GATES[0], *GATES[2:], (4.0, 55.0)], 4),  # one is left out
        ([(0.0, 60.0)], 0),  # straight on
        ([(4.0, 60.0)], 1),
        ([(x - 1.6, y) for x, y in GATES], 0),  # beside every gate
        ([(x + 1.4, y) for x, y in GATES[:4]] + [(0, 60)], 4),
        ([(20, 5), (20, 60), (4, 60), *GATES[::-1], (0, 0)], 0),  # backwards
        ([(4, 9), (4, 11), (4, 9), (4, 11), (4, 9), (4, 11), (4, 9), (4, 11)], 1),  # to and fro
        ([(-4, 15), (-4, 22), (9, 22), (9, 5), *GATES[:1], (4, 12)], 1),  # out of order
        ([(4, 9), (4, 10)], 1),
    ],
)
def test_which_gates_count(tasks, car, through, gates) -> None:
    result = slalom(tasks, car, through)
    assert result.metrics["gates"] == gates
    assert result.success == (gates >= 4)
    assert gates <= result.indicator < gates + 1


def test_a_gate_that_nobody_passed_is_worth_nothing(tasks, car) -> None:
    assert slalom(tasks, car, [(0.0, 9.0)]).indicator == 0.0


def test_a_car_without_one_of_its_wheels_passes_no_more_gates(tasks, car) -> None:
    whole = slalom(tasks, car, GATES)
    torn = slalom(tasks, car, GATES, torn_s=float(whole.metrics["last_gate_s"]) / 2)
    assert 0 < torn.metrics["gates"] < 4
    assert not torn.success
    assert torn.metrics["wheels_lost"]


def test_a_car_that_is_thrown_through_the_gates_has_not_driven(tasks, car) -> None:
    thrown = slalom(tasks, car, GATES, driven=False)
    assert (thrown.success, thrown.indicator, thrown.flags) == (False, 0.0, ("not_driven",))


def test_a_machine_without_wheels_passes_no_gate(tasks, engine_machine) -> None:
    trial = make_trajectory(engine_machine, 30.0, heated=[False, False])
    moved = np.zeros((751, 1, 3), dtype=np.float32)
    moved[:, 0, 1] = np.linspace(0, 60, 751)
    moved[:, 0, 0] = np.interp(moved[:, 0, 1], [y for _, y in GATES], [x for x, _ in GATES])
    trial = with_bearing(replace(trial, positions=trial.positions + moved))
    assert score(tasks["mechanisms-2"], engine_machine, trial).indicator == 0.0


def test_a_gate_that_half_a_car_passed_does_not_count(tasks, car) -> None:
    """The starting block may be beside a gate; wheels and mass may not."""
    trial = drive(car, [*GATES, (4.0, 55.0)])
    wheels = [trial.block_ids.index(block) for block in wheels_of(car)]
    heavy = [trial.block_ids.index("2"), trial.block_ids.index("3"), *wheels]

    def shifted(columns: list[int]) -> Score:
        positions = trial.positions.copy()
        positions[:, columns, 0] -= 3.0
        return score(tasks["mechanisms-2"], car, replace(trial, positions=positions))

    assert shifted([0]).metrics["gates"] == 5, "the starting block alone"
    assert shifted(wheels).metrics["gates"] == 0, "the wheels alone"
    assert shifted(heavy).metrics["gates"] == 0, "all but the starting block"
    others = [k for k in range(len(trial.block_ids)) if k not in wheels]
    loaded = shifted(others)
    share = 3.0 * sum(car.blocks[trial.block_ids[k]].module.mass for k in others) / float(car.mass)
    assert (loaded.metrics["gates"] == 5) == (share <= 1.5)


def test_a_gate_is_passed_when_the_last_of_the_car_has_passed_it(tasks, car) -> None:
    trial = drive(car, [*GATES, (4.0, 55.0)])
    wheels = [trial.block_ids.index(block) for block in wheels_of(car)]
    positions = trial.positions.copy()
    positions[:, wheels, 1] -= 1.0
    whole = slalom(tasks, car, [*GATES, (4.0, 55.0)])
    behind = score(tasks["mechanisms-2"], car, replace(trial, positions=positions))
    late_s = behind.metrics["last_gate_s"] - whole.metrics["last_gate_s"]
    assert late_s == pytest.approx(1.0 / (4.0 * 0.78), abs=0.1)


# Winch

POWERED, MEDIUM, LARGE = "Cog Medium Powered", "Cog Medium Unpowered", "Cog Large Unpowered"


def gear_train(*cogs: str, apart: int = 3, pivot: str = LARGE) -> Draft:
    """A bar whose first block bears an arm on a pivot; a driven cog on its last.

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


def turned_deg(machine: Machine, trial: Trajectory, module: str, degrees: np.ndarray) -> Trajectory:
    """The trajectory with all blocks of a module turned by angles (T,) about the north."""
    half = np.radians(degrees) / 2
    still = np.zeros_like(half)
    turns = np.column_stack([np.cos(half), still, np.sin(half), still])
    quaternions = trial.quaternions.copy()
    for block in machine.blocks.values():
        if block.module.name == module:
            quaternions[:, trial.block_ids.index(block.id)] = turns
    return replace(trial, quaternions=quaternions)


def lift(
    machine: Machine,
    *,
    rise: Path = lambda t: 6.0 * ramp(t, 2.0, 15.0),
    borne: object = 20.0,
    ground: object = None,
    turn: Path = lambda t: 60.0 * ramp(t, 2.0, 15.0),
) -> Trajectory:
    def cargo(t: np.ndarray) -> np.ndarray:
        return np.column_stack([np.zeros_like(t), np.full_like(t, 6.0), 0.5 + rise(t) * (t > 0)])

    trial = make_trajectory(machine, 30.0, cargo=cargo, cargo_mass=lambda t: np.full_like(t, 20.0))
    weight = float(machine.mass) + np.asarray(borne) if ground is None else ground
    trial = turned_deg(machine, trial, LARGE, turn(trial.time_s))
    held = Event(time_s=0.0, what="grabbed", joint=list(machine.blocks)[-1], held="cargo")
    return with_bearing(replace(trial, events=(held,)), cargo=borne, ground=weight)


@pytest.fixture(scope="module")
def train() -> Machine:
    return gear_train().machine


def winch(tasks: dict[str, Task], machine: Machine, **how: object) -> Score:
    return score(tasks["mechanisms-3"], machine, lift(machine, **how))  # type: ignore[arg-type]


def test_a_cargo_that_is_lifted_and_held(tasks, train) -> None:
    result = winch(tasks, train)
    assert result.success
    assert result.indicator == pytest.approx(120.0)
    assert not winch(tasks, train, rise=lambda t: 4.9 * ramp(t, 2.0, 15.0)).success
    lower = winch(tasks, train, rise=lambda t: 4.9 * ramp(t, 2.0, 15.0))
    assert lower.indicator == pytest.approx(98)


@pytest.mark.parametrize(
    ("rise", "held"),
    [
        (lambda t: 9.0 * ramp(t, 19.0, 19.5) * (t < 24.8), 0.0),  # held for too short a time
        (lambda t: (9.0 - 0.2 * np.maximum(t - 20.0, 0.0)) * (t > 1), 0.0),  # sinks all the time
        (lambda t: (9.0 - 0.1 * np.maximum(t - 20.0, 0.0)) * (t > 1), 8.5),  # slowly enough
        (lambda t: 6.0 * ramp(t, 2.0, 8.0) - 6.0 * ramp(t, 14.0, 19.0), 0.0),  # let down before
        (lambda t: (6.0 + 0.5 * np.sin(9 * t)) * (t > 1), 0.0),  # swings
        (lambda t: (6.0 + 0.25 * np.sin(9 * t)) * (t > 1), 5.75),
        (lambda t: 9.0 * np.sin(np.pi * ramp(t, 20.0, 30.0)), 8.9),  # thrown high and slow
    ],
)
def test_what_is_held(tasks, train, rise, held) -> None:
    found = winch(tasks, train, rise=rise, turn=lambda t: 60.0 * (t > 1.0))
    held_height = found.metrics["held_height"]
    assert held_height == pytest.approx(held, abs=0.11 if held != 8.9 else 9.0)


@pytest.mark.parametrize(
    ("how", "flag"),
    [
        ({"borne": 0.0}, "not_carried"),  # thrown, or lies on a terrain
        ({"borne": 14.0}, "not_carried"),
        ({"ground": 0.0}, "not_standing"),  # balloons or fans hold it
        ({"ground": 10.0}, "not_standing"),
        ({"turn": lambda t: 19.0 * ramp(t, 2.0, 15.0)}, "not_geared"),
        ({"turn": lambda t: 60.0 * ramp(t, 0.0, 0.9)}, "not_geared"),  # before the key
        ({"turn": lambda t: 60.0 * ramp(t, 15.5, 19.0)}, "not_geared"),  # once it is up
        ({"rise": lambda t: 0.31 * ramp(t, 0, 0.5) + 6.0 * ramp(t, 2, 15)}, "not_geared"),
    ],
)
def test_who_holds_it(tasks, train, how, flag) -> None:
    result = winch(tasks, train, **how)
    assert (result.success, result.indicator, result.flags) == (False, 0.0, (flag,))


@pytest.mark.parametrize(
    ("draft", "counts"),
    [
        (gear_train(MEDIUM, apart=5), True),  # by another cog
        (gear_train(MEDIUM, MEDIUM, apart=7), True),
        (gear_train(apart=4), False),  # in no mesh
        (gear_train(MEDIUM, apart=6), False),
        (gear_train(pivot=MEDIUM, apart=2), False),  # no large one
        (gear_train(pivot="Swivel"), False),
    ],
)
def test_what_the_gears_must_be(tasks, draft, counts) -> None:
    assert winch(tasks, draft.machine).success == counts


def test_a_gear_beside_what_holds_the_cargo_raises_nothing(tasks) -> None:
    draft = gear_train()
    base = draft.attach("8", UP)
    assert winch(tasks, draft.machine).flags == ("not_geared",), "the base holds the cargo"
    draft.connect(base, "13", UP, connector="Winch")
    assert winch(tasks, draft.machine).flags == ("not_geared",), "a rope goes round the axle"


def test_a_shaft_may_have_two_bearings(tasks) -> None:
    draft = gear_train()
    arm = next(b.id for b in draft.machine.blocks.values() if b.center[1] > 1.5)
    post = draft.row(draft.row("1", SOUTH, 1)[-1], DOWN, 3)[-1]
    beyond = draft.row(draft.row(post, NORTH, 6)[-1], UP, 3)[-1]
    swivel = draft.attach(beyond, SOUTH, "Swivel")
    end = draft.attach(swivel, SOUTH)
    draft.connect(end, arm, UP)
    draft.row(arm, UP, 1)
    assert winch(tasks, draft.machine).success


def test_without_a_key_nothing_is_raised(tasks, train) -> None:
    machine = train.copy()
    assert machine.act("remove_control_sequence", {"index": 0}).ok
    assert winch(tasks, machine).flags == ("not_geared", "unstable"), "the energy is from nowhere"


def test_the_keys_that_were_played_decide(tasks, train) -> None:
    trial = lift(train)
    for presses, flags in (
        ([["UpArrow", 1.0, 5.0]], ()),
        ([["Alpha1", 1.0, 5.0]], ("not_geared", "unstable")),
    ):
        played = replace(trial, settings={"presses": json.dumps(presses)})
        assert score(tasks["mechanisms-3"], train, played).flags == flags


def test_a_machine_that_came_apart_holds_nothing(tasks, train) -> None:
    trial = with_pieces(lift(train), list(train.blocks)[1:3], since_s=12.0)
    result = score(tasks["mechanisms-3"], train, trial)
    assert (result.success, result.flags) == (False, ("came_apart",))


# Pick and place


def carry(
    machine: Machine,
    *,
    top: float = 4.0,
    end: tuple[float, float] = (4.0, 3.0),
    around: float = 0.0,
    borne: Path = lambda t: np.where((t > 2) & (t < 12), 2.0, 0.0),
    base: Path | None = None,
    shiver: float = 0.0,
) -> Trajectory:
    """A cargo lifted, carried over and put down from 2 to 12 s."""

    def cargo(t: np.ndarray) -> np.ndarray:
        over = ramp(t, 5.0, 9.0)
        up = ramp(t, 2.2, 5.0) - ramp(t, 9.0, 11.8)
        aside = around * np.sin(np.pi * over)
        east = -4.0 + (end[0] + 4.0) * over
        north = 3.0 + (end[1] - 3.0) * over + aside
        still = shiver * (t > 15) * np.sin(20 * t)
        return np.column_stack([east + still, north, 0.5 + top * up])

    trial = make_trajectory(
        machine, 30.0, moved=base, cargo=cargo, cargo_mass=lambda t: np.full_like(t, 2.0)
    )
    trial = replace(trial, cargo_size=(1.0, 1.0, 1.0))
    return with_bearing(trial, cargo=borne(trial.time_s))


def place(tasks: dict[str, Task], machine: Machine, **how: object) -> Score:
    return score(tasks["mechanisms-4"], machine, carry(machine, **how))  # type: ignore[arg-type]


def test_a_cargo_that_is_carried_over_the_wall(tasks, car) -> None:
    exact, near = place(tasks, car), place(tasks, car, end=(4.0, 3.5))
    assert exact.success
    assert exact.indicator == pytest.approx(10.0)
    assert near.success
    assert near.indicator == pytest.approx(2.0)


def _throw(t: np.ndarray) -> np.ndarray:
    return np.where((t > 2) & (t < 5.5), 2.0, 0.0)


@pytest.mark.parametrize(
    ("how", "flags", "indicator"),
    [
        ({"end": (4.0, 4.1)}, (), 1 / 1.1),  # too far from the mark
        ({"end": (3.2, 3.0)}, None, 1 / 0.8),
        ({"borne": np.zeros_like}, ("not_carried",), 0.0),  # kicked
        ({"borne": _throw}, ("not_carried",), 0.0),  # thrown
        ({"top": 1.5}, ("not_carried",), 0.0),  # through the wall's end, or round it
        ({"top": 0.0, "around": 9.0}, ("not_carried",), 0.0),  # pushed round it
        ({"borne": lambda t: np.where(t > 2, 2.0, 0.0)}, (), 10.0),  # never put down
        ({"shiver": 0.2}, (), None),  # does not come to rest
        ({"base": lambda t: np.outer(ramp(t, 3, 9), [0.6, 0, 0])}, ("base_moved",), 0.0),
        ({"base": lambda t: np.outer(np.sin(t), [0, 0.51, 0])}, ("base_moved",), 0.0),
        ({"base": lambda t: np.outer(ramp(t, 3, 9), [0.4, 0, 0])}, None, 10.0),
    ],
)
def test_what_is_carried(tasks, car, how, flags, indicator) -> None:
    result = place(tasks, car, **how)
    assert result.success == (flags is None)
    assert result.flags == (flags or ())
    if indicator is not None:
        assert result.indicator == pytest.approx(indicator, rel=1e-3)


def test_a_machine_that_leaves_parts_behind_has_placed_nothing(tasks, car) -> None:
    trial = with_pieces(carry(car), list(car.blocks)[-2:], since_s=8.0)
    result = score(tasks["mechanisms-4"], car, trial)
    assert (result.success, result.indicator, result.flags) == (False, 0.0, ("came_apart",))


def test_a_cargo_that_nobody_touched_is_worth_nothing(tasks, car) -> None:
    result = place(tasks, car, end=(-4.0, 3.0), top=0.0)
    assert (result.success, result.indicator) == (False, 0.0)


@pytest.mark.parametrize("name", [f"mechanisms-{level}" for level in (1, 2, 3, 4)])
def test_without_forces_nothing_can_be_judged(tasks, car, name) -> None:
    trials = {
        "mechanisms-1": ride(car),
        "mechanisms-2": drive(car, GATES),
        "mechanisms-3": lift(gear_train().machine),
        "mechanisms-4": carry(car),
    }
    machine = gear_train().machine if name == "mechanisms-3" else car
    result = score(tasks[name], machine, replace(trials[name], bearing=None))
    assert (result.success, result.indicator) == (False, 0.0)
    assert result.flags == ("forces_not_measured",)
