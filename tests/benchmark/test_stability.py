"""Which rollouts blew up, and which merely went badly. Trajectories made by hand."""

from dataclasses import replace

import numpy as np
import pytest
from support.machines.building import BLOCK, attach, built
from tests.benchmark.conftest import make_trajectory, with_bearing, with_pieces

from buildarena_benchmark import score
from buildarena_benchmark.scorers.measures.energy import gains_energy
from buildarena_geometry import module_set
from buildarena_simulation.constants import GRAVITY


def _ramp(t: np.ndarray) -> np.ndarray:
    return 5 + 1495 * np.clip((t - 0.5) / 15, 0.005, 1)


def _bridge(machine, *, falls_at: float = 8.0):
    """A cargo that is carried at 6.75 and falls freely from a time on."""

    def path(t: np.ndarray) -> np.ndarray:
        sunk = GRAVITY / 2 * np.maximum(t - falls_at, 0.0) ** 2
        height = np.maximum(np.minimum(9.0 - GRAVITY / 2 * t**2, 9.0), 6.75) - sunk
        return np.column_stack([np.zeros_like(t), np.zeros_like(t), np.maximum(height, 0.75)])

    return make_trajectory(machine, 17.0, cargo=path, cargo_mass=_ramp)


def _kicked(trial, blocks, *, at: float, speed: float, samples: int):
    """The trajectory in which blocks are thrown east for some samples, then stay."""
    positions = trial.positions.copy()
    first = round(at * 25)
    count = len(positions) - first
    way = np.minimum(np.arange(1, count + 1), samples) * speed / 25
    for block in blocks:
        positions[first:, trial.block_ids.index(block), 0] += way
    return replace(trial, positions=positions)


def test_debris_of_a_collapse_is_not_unstable(tasks, car) -> None:
    trial = with_pieces(_bridge(car), ["4", "5"], since_s=7.9)
    for at in (7.96, 8.2, 9.0):
        debris = _kicked(trial, ["4", "5"], at=at, speed=69.0, samples=10)
        assert "unstable" not in score(tasks["support-1"], car, debris).flags


@pytest.mark.parametrize(
    ("kick", "unstable"),
    [
        ((2000.0, 1), False),  # a solver's correction, over at once
        ((2000.0, 2), False),
        ((2000.0, 3), True),
        ((500.0, 10), True),
    ],
)
def test_a_blow_up_lasts(tasks, car, kick, unstable) -> None:
    speed, samples = kick
    trial = _bridge(car)
    kicked = _kicked(trial, car.blocks, at=4.0, speed=speed, samples=samples)
    assert ("unstable" in score(tasks["support-1"], car, kicked).flags) == unstable


def test_what_happens_after_the_fall_decides_nothing(tasks, car) -> None:
    trial = _bridge(car)
    late = _kicked(trial, car.blocks, at=9.0, speed=2000.0, samples=20)
    assert "unstable" not in score(tasks["support-1"], car, late).flags
    positions = trial.positions.copy()
    positions[trial.time_s > 9.0] = np.nan
    assert score(tasks["support-1"], car, replace(trial, positions=positions)).success
    positions = trial.positions.copy()
    positions[trial.time_s > 7.0] = np.nan
    lost = score(tasks["support-1"], car, replace(trial, positions=positions))
    assert (lost.success, lost.indicator) == (False, 0.0)
    assert "unstable" in lost.flags


def test_a_cargo_that_is_shot_away_is_unstable(tasks, car) -> None:
    trial = _bridge(car, falls_at=99.0)
    cargo = trial.cargo_position.copy()
    cargo[trial.time_s > 6.0, 2] += 40.0 * np.arange((trial.time_s > 6.0).sum())
    shot = score(tasks["support-1"], car, replace(trial, cargo_position=cargo))
    assert "unstable" in shot.flags


def test_a_part_that_came_off_decides_nothing(tasks, engine_machine) -> None:
    def climb(t: np.ndarray) -> np.ndarray:
        return np.column_stack([np.zeros((len(t), 2)), 40.0 * np.maximum(t - 2.0, 0.0)])

    flight = make_trajectory(engine_machine, 30.0, moved=climb, heated=(True, True))
    shot = _kicked(flight, ["3"], at=6.0, speed=20_000.0, samples=200)
    assert "unstable" in score(tasks["lift-2"], engine_machine, shot).flags
    off = with_pieces(shot, ["3"], since_s=5.9)
    assert score(tasks["lift-2"], engine_machine, off).flags == ()


def test_a_rocket_may_be_as_fast_as_its_thrust_makes_it(tasks, engine_machine) -> None:
    push = (2 * 13.76 / 3.25 - 1.0) * GRAVITY

    def flight(factor: float):
        def climb(t: np.ndarray) -> np.ndarray:
            up = factor * push / 2 * np.maximum(t - 2.0, 0.0) ** 2
            return np.column_stack([np.zeros((len(t), 2)), up])

        trial = make_trajectory(engine_machine, 30.0, moved=climb, heated=(True, True))
        return score(tasks["lift-2"], engine_machine, trial)

    assert flight(1.0).success
    assert "unstable" in flight(3.0).flags


def _flown(machine, *, climb: float, speed: float = 15.0, sink: float = 0.0):
    """A flight at a speed, from 40 up that climbs evenly for 10 s."""

    def moved(t: np.ndarray) -> np.ndarray:
        up = 40.0 + climb * np.minimum(t, 10.0) / 10.0 - sink * t
        return np.column_stack([np.zeros_like(t), speed * t, up])

    return make_trajectory(machine, 12.0, moved=moved)


@pytest.mark.parametrize(
    ("how", "gains"),
    [
        ({"climb": 20.0}, True),
        ({"climb": 5.0}, True),
        ({"climb": 1.0}, False),  # within what engines err
        ({"climb": 0.0}, False),
        ({"climb": 0.0, "speed": 21.0}, True),
        ({"climb": 2.0, "speed": 9.0}, False),  # it climbs on its speed
        ({"climb": 0.0, "speed": 24.0, "sink": 3.0}, True),
    ],
)
def test_what_nothing_drives_gains_no_energy(tasks, how, gains) -> None:
    machine = built(*(("1", face, BLOCK) for face in "ABE"))
    flown = score(tasks["flight-2"], machine, with_bearing(_flown(machine, **how)))
    assert ("unstable" in flown.flags) == gains


def test_what_drives_a_machine_may_give_it_energy(tasks, car) -> None:
    flight = _flown(car, climb=20.0)
    for presses, gains in (("[]", True), ('[["UpArrow",0.0,1.0]]', False), ('[["x",0,1]]', True)):
        trial = with_bearing(replace(flight, settings={"presses": presses}))
        task = tasks["transport-1"]
        assert gains_energy(task.scenario, car, trial, 300) == gains


@pytest.mark.parametrize("module", ["Balloon", "Sqr Balloon"])
def test_balloons_drive_a_machine(tasks, module) -> None:
    machine = built(("1", "E", BLOCK), catalogue=module_set("workshop"))
    risen = with_bearing(_flown(machine, climb=20.0))
    assert gains_energy(tasks["flight-1"].scenario, machine, risen, 300)
    assert attach(machine, "2", "E", module).ok
    risen = with_bearing(_flown(machine, climb=20.0))
    assert not gains_energy(tasks["flight-1"].scenario, machine, risen, 300)


def test_a_cargo_that_grows_brings_energy(tasks, car) -> None:
    trial = _bridge(car, falls_at=99.0)
    assert not gains_energy(tasks["support-1"].scenario, car, trial, len(trial.time_s))
    cargo = trial.cargo_position.copy()
    cargo[:, 2] += 0.2 * np.maximum(trial.time_s - 8.0, 0.0)
    raised = replace(trial, cargo_position=cargo)
    assert gains_energy(tasks["support-1"].scenario, car, raised, len(trial.time_s))
