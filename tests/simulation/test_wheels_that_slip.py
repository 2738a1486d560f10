"""Cars whose wheels slip, held against a planar model by Coulomb's law, on both engines."""

import numpy as np
import pytest
from support.machines.families import car
from support.machines.headroom import drafted
from support.machines.random_workshop import random_workshop_machine
from support.planar_car import planar_car

from buildarena_benchmark import builtin_tasks
from buildarena_geometry import Machine
from buildarena_simulation import Scenario, Trajectory, simulate
from buildarena_simulation.scenario import Control
from buildarena_worker.builtin.designs.rovers import slalom_car

STARTS_S, DURATION_S = 0.48, 4.48


def _wheels(machine: Machine) -> list[str]:
    return [b.id for b in machine.blocks.values() if b.module.name == "Powered Wheel"]


def _braked(braked: tuple[int, ...], length: int, track: int) -> tuple[Machine, list[str]]:
    """A car with some of its wheels on keys that nobody presses: they brake."""
    machine = car(length, track, drive=[("UpArrow", STARTS_S, 20.0)])
    return machine, _hold(machine, braked)


def _hold(machine: Machine, braked: tuple[int, ...]) -> list[str]:
    """Takes some of a car's wheels off its keys; returns their ids."""
    held = [_wheels(machine)[k] for k in braked]
    for wheel in held:
        for action, key in (("forward", "Alpha1"), ("backward", "Alpha2")):
            told = {"block_id": wheel, "action": f"spinning_{action}", "new_key": key}
            assert machine.act("change_control_key", told).ok
    return held


def _heading(machine: Machine, trajectory: Trajectory) -> np.ndarray:
    """Heading over time, rad, anticlockwise: from the middle of the rear wheels to the front's."""
    order = list(machine.blocks)
    front_right, front_left, back_right, back_left = (
        trajectory.positions[:, order.index(wheel)].astype(float) for wheel in _wheels(machine)
    )
    ahead = front_right + front_left - back_right - back_left
    return np.unwrap(np.arctan2(-ahead[:, 0], ahead[:, 1]))


def _driven(machine: Machine, engine: str) -> tuple[float, float]:
    """How far a car travels, units, and how much it turns, rad."""
    scenario = Scenario(duration_s=DURATION_S, control=Control(mode="agent"))
    trajectory = simulate(machine, scenario, engine)
    places = trajectory.positions[:, 0, :2].astype(float)
    heading = _heading(machine, trajectory)
    travelled = np.linalg.norm(np.diff(places, axis=0), axis=1).sum()
    return float(travelled), float(heading[-1] - heading[0])


@pytest.mark.nightly(keep=3)
@pytest.mark.parametrize(
    ("braked", "length", "track"),
    [((0,), 5, 1), ((1,), 5, 1), ((2,), 5, 1), ((3,), 5, 1), ((0,), 9, 1), ((3,), 7, 2)],
)
def test_a_car_with_a_braking_wheel_turns_and_travels_as_coulomb_says(
    engine, braked, length, track
) -> None:
    machine, held = _braked(braked, length, track)
    expected = planar_car(machine, held).drive(DURATION_S - STARTS_S)
    travelled, turned = _driven(machine, engine)
    assert travelled == pytest.approx(expected.travelled, rel=0.05)
    assert turned == pytest.approx(expected.turned, rel=0.05)


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("braked", [0, 3])
def test_wheels_on_hinges_that_only_steer_share_their_load_alike(engine, braked) -> None:
    """The hinges' drives give way a little: the turn may differ more than a rigid car's."""
    machine = drafted(slalom_car(0), [(STARTS_S, "UpArrow", 20.0)])
    expected = planar_car(machine, _hold(machine, (braked,))).drive(DURATION_S - STARTS_S)
    travelled, turned = _driven(machine, engine)
    assert travelled == pytest.approx(expected.travelled, rel=0.01)
    assert turned == pytest.approx(expected.turned, rel=0.06)


@pytest.mark.parametrize("braked", [(0,), (2,), (0, 1)])
def test_the_ground_bears_a_slipping_car_evenly(engine, braked) -> None:
    machine, _ = _braked(braked, 5, 1)
    scenario = Scenario(duration_s=DURATION_S, control=Control(mode="agent"))
    trajectory = simulate(machine, scenario, engine)
    weight = sum(block.module.mass for block in machine.blocks.values())
    driving = trajectory.time_s > STARTS_S + 0.2
    borne = trajectory.bearing.ground[driving]
    assert borne.min() > 0.7 * weight
    assert borne.max() < 1.4 * weight


def _on_the_rough_road(seed: int, engine: str, duration_s: float) -> tuple[Machine, Trajectory]:
    """A vehicle on suspensions under a cargo, on a road with ridges from y = 5 on."""
    machine = random_workshop_machine("mechanisms-1", seed)
    scenario = builtin_tasks()["mechanisms-1"].scenario
    return machine, simulate(
        machine, scenario.model_copy(update={"duration_s": duration_s}), engine
    )


@pytest.mark.ci
@pytest.mark.parametrize("seed", [5, 8, 10])
def test_edges_under_wheels_push_nothing_on(engine, seed) -> None:
    """A vehicle on ridges is no faster than its motors turn its wheels, and falls on none."""
    machine, trajectory = _on_the_rough_road(seed, engine, 3.6)
    wheel = next(b.module for b in machine.blocks.values() if b.module.name == "Large Wheel")
    assert wheel.motor is not None
    rim = wheel.motor.speed * wheel.size[0] / 2
    speed = np.diff(trajectory.positions[:, 0, 1].astype(float)) * 25.0
    assert 0.6 * rim < speed.max() < 1.05 * rim


@pytest.mark.ci
@pytest.mark.parametrize("seed", [5, 8])
def test_the_ground_bears_a_vehicle_on_suspensions_by_its_weight(engine, seed) -> None:
    machine, trajectory = _on_the_rough_road(seed, engine, 1.2)
    standing = trajectory.time_s > 0.8
    wheels = trajectory.bearing.wheels[standing].reshape(standing.sum(), -1)
    weight = 10.0 + sum(block.module.mass for block in machine.blocks.values())
    assert wheels.sum(axis=1).mean() == pytest.approx(weight, rel=0.15)
