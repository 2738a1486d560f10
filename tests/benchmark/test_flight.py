"""Flight: what counts, and what does not. Trajectories made by hand."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from tests.benchmark.conftest import make_trajectory, with_bearing, with_pieces

from buildarena_benchmark import Score, Task, score
from buildarena_geometry import Machine
from buildarena_simulation import Trajectory

Path = Callable[[np.ndarray], np.ndarray]


def still(t: np.ndarray) -> np.ndarray:
    return np.zeros_like(t)


# Hover


def hover(
    machine: Machine,
    *,
    height: Path = lambda t: np.interp(t, [0, 5, 14, 16], [0.5, 10, 10, 0.5]),
    aside: Path = still,
    tilt_deg: float = 0.0,
    borne: object = 5.0,
    ground: object = 0.0,
) -> Trajectory:
    start = next(iter(machine.blocks.values())).center[2]

    def moved(t: np.ndarray) -> np.ndarray:
        return np.column_stack([aside(t), np.zeros_like(t), height(t) - start])

    trial = make_trajectory(
        machine,
        20.0,
        moved=moved,
        cargo=lambda t: moved(t) + np.array([0, 0, 2]),
        cargo_mass=lambda t: np.full_like(t, 5.0),
    )
    half = np.radians(tilt_deg) / 2 * (trial.time_s > 1.0)
    turned = np.stack([np.cos(half), np.sin(half), still(half), still(half)], axis=1)
    quaternions = np.repeat(turned[:, None], len(trial.block_ids), axis=1)
    trial = replace(trial, quaternions=quaternions.astype(np.float32))
    return with_bearing(trial, cargo=borne, ground=ground)


def hovered(tasks: dict[str, Task], machine: Machine, **how: object) -> Score:
    return score(tasks["flight-1"], machine, hover(machine, **how))  # type: ignore[arg-type]


def test_a_machine_that_holds_its_height(tasks, car) -> None:
    result = hovered(tasks, car)
    # In the band from 8.5 on the way up to 8.5 on the way down.
    assert result.success
    assert result.indicator == pytest.approx(9 + 1.5 / 1.9 + 1.5 / 4.75, abs=0.1)


@pytest.mark.parametrize(
    ("how", "success", "flags"),
    [
        ({"height": lambda t: 0.5 + 30 * t - 16.4 * t**2}, False, ()),  # thrown through the band
        ({"height": lambda t: 10 + 2 * np.sin(2 * t)}, False, ()),  # in and out
        ({"height": lambda t: 0.5 + (9.5 + 1.4 * np.sin(2 * t)) * (t > 0)}, True, ()),
        ({"height": lambda t: np.interp(t, [0, 2, 9, 20], [0.5, 10, 10, 60])}, False, ()),
        ({"tilt_deg": 21.0}, False, ()),
        ({"tilt_deg": 19.0}, True, ()),
        ({"aside": lambda t: 0.6 * t}, False, ()),  # drifts off
        ({"aside": lambda t: 0.3 * t}, True, ()),
        ({"borne": 0.0}, False, ("not_carried",)),
        ({"borne": 3.5}, False, ("not_carried",)),  # half of it hangs on something else
        ({"ground": 3.0}, False, ("not_airborne",)),  # a tower, or an anchor on a rope
        ({"ground": 0.05}, True, ()),
    ],
)
def test_what_is_hovering(tasks, car, how, success, flags) -> None:
    result = hovered(tasks, car, **how)
    assert (result.success, result.flags) == (success, flags)
    assert success or result.indicator < 8


def test_what_was_dropped_may_lie_on_the_ground(tasks, car) -> None:
    dropped = list(car.blocks)[-2:]
    weight = sum(car.blocks[block].module.mass for block in dropped)
    trial = hover(car, ground=np.where(np.arange(501) > 100, weight, 0.0))
    kept = score(tasks["flight-1"], car, trial)
    assert kept.flags == ("not_airborne",)
    assert score(tasks["flight-1"], car, with_pieces(trial, dropped, since_s=2.0)).success


def hang_below(machine: Machine, trial: Trajectory, low: float) -> Trajectory:
    """The trajectory in which a wheel's lowest point is at a height from 3 s on."""
    positions = trial.positions.copy()
    column = trial.block_ids.index(next(b.id for b in machine.blocks.values() if b.module.spins))
    positions[trial.time_s > 3, column, 2] = low + 1.0  # its radius
    return replace(trial, positions=positions)


@pytest.mark.parametrize(
    ("low", "flags"), [(5.05, ()), (4.95, ("not_risen",)), (0.3, ("not_risen",))]
)
def test_no_part_stays_near_the_ground(tasks, car, low, flags) -> None:
    turned = replace(
        hover(car), quaternions=np.tile(np.float32([0.5**0.5, 0, 0.5**0.5, 0]), (501, 11, 1))
    )
    result = score(tasks["flight-1"], car, hang_below(car, turned, low))
    assert (result.success, result.flags) == (not flags, flags)


@pytest.mark.parametrize(("begin", "success"), [(0.5, True), (1.9, True), (2.7, False), (9, False)])
def test_the_starting_block_has_risen(tasks, car, begin, success) -> None:
    result = hovered(
        tasks, car, height=lambda t: np.interp(t, [0, 3, 14, 16], [begin, 9.6, 9.6, 0])
    )
    assert result.success == success
    assert result.flags == (() if success else ("not_risen",))


def test_a_part_that_came_off_may_lie_on_the_ground(tasks, car) -> None:
    wheel = next(b.id for b in car.blocks.values() if b.module.spins)
    trial = with_pieces(hang_below(car, hover(car), 0.0), [wheel], since_s=2.9)
    assert score(tasks["flight-1"], car, trial).success


# Glide


def glide(
    machine: Machine,
    *,
    speed: float = 15.0,
    sink: float = 4.0,
    flare: float | None = None,
    land: bool = True,
) -> Trajectory:
    end_s = 40.0 / sink

    def moved(t: np.ndarray) -> np.ndarray:
        fall = 40.0 - np.minimum(sink * t, 40.0)
        if flare is not None:
            fall = np.where(t > end_s - 1, flare * np.maximum(end_s - t, 0), fall)
        way = speed * np.minimum(t, end_s)
        return np.column_stack([np.zeros_like(t), way, fall])

    trial = make_trajectory(machine, 30.0, moved=moved)
    touches = trial.time_s > end_s - 1e-9
    return with_bearing(trial, ground=np.where(touches & land, float(machine.mass), 0.0))


def glided(tasks: dict[str, Task], machine: Machine, **how: object) -> Score:
    return score(tasks["flight-2"], machine, glide(machine, **how))  # type: ignore[arg-type]


def test_a_glider_that_lands_gently(tasks, car) -> None:
    result = glided(tasks, car)
    assert result.success
    assert result.indicator == pytest.approx(150 / 40, rel=0.01)
    assert result.metrics["sink_at_landing"] == pytest.approx(4.0, rel=0.01)


@pytest.mark.parametrize(
    ("how", "success"),
    [
        ({"speed": 7.9}, False),  # not far enough
        ({"speed": 8.2}, True),
        ({"sink": 6.5, "speed": 20.0}, False),  # too hard
        ({"sink": 6.5, "speed": 20.0, "flare": 3.0}, True),  # a flare before the ground
        ({"sink": 3.0, "flare": 9.0}, False),  # a dive at the end
        ({"land": False}, False),  # never comes down
        ({"sink": 1.0, "speed": 15.0, "land": True}, False),  # not within the trial
        ({"sink": 25.6, "speed": 15.0}, False),  # a stone
    ],
)
def test_what_is_a_glide(tasks, car, how, success) -> None:
    assert glided(tasks, car, **how).success == success


def test_the_flight_ends_at_the_first_touch(tasks, car) -> None:
    """A machine that bounces, or slides on, flies no farther."""
    trial = glide(car)
    touched = np.zeros(751)
    touched[100] = 30.0  # touches at 4 s, and flies on
    result = score(tasks["flight-2"], car, with_bearing(trial, ground=touched))
    assert (result.success, result.indicator) == (False, 0.0)
    assert result.metrics["range"] == pytest.approx(60, rel=0.01)


def test_what_came_off_does_not_soften_the_landing(tasks, car) -> None:
    """The speed is that of what is still joined to the starting block."""
    trial = glide(car, sink=8.0, speed=20.0)
    positions = trial.positions.copy()
    light = list(car.blocks)[3:]
    columns = [trial.block_ids.index(block) for block in light]
    positions[:, columns, 2] = 60.0
    result = score(
        tasks["flight-2"], car, with_pieces(replace(trial, positions=positions), light, since_s=1)
    )
    assert result.metrics["sink_at_landing"] == pytest.approx(8.0, rel=0.01)
    assert not result.success


@pytest.mark.parametrize("name", ["flight-1", "flight-2"])
def test_without_forces_nothing_can_be_judged(tasks, car, name) -> None:
    trial = hover(car) if name == "flight-1" else glide(car)
    result = score(tasks[name], car, replace(trial, bearing=None))
    assert (result.success, result.flags) == (False, ("forces_not_measured",))
