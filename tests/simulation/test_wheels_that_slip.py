"""Cars whose wheels slip, held against a planar model by Coulomb's law, on both engines."""

import numpy as np
import pytest
from support.machines.families import car
from support.planar_car import planar_car

from buildarena_geometry import Machine
from buildarena_simulation import Scenario, Trajectory, simulate
from buildarena_simulation.scenario import Control

STARTS_S, DURATION_S = 0.48, 4.48


def _wheels(machine: Machine) -> list[str]:
    return [b.id for b in machine.blocks.values() if b.module.name == "Powered Wheel"]


def _braked(braked: tuple[int, ...], length: int, track: int) -> tuple[Machine, list[str]]:
    """A car with some of its wheels on keys that nobody presses: they brake."""
    machine = car(length, track, drive=[("UpArrow", STARTS_S, 20.0)])
    held = [_wheels(machine)[k] for k in braked]
    for wheel in held:
        for action, key in (("forward", "Alpha1"), ("backward", "Alpha2")):
            told = {"block_id": wheel, "action": f"spinning_{action}", "new_key": key}
            assert machine.act("change_control_key", told).ok
    return machine, held


def _heading(machine: Machine, trajectory: Trajectory) -> np.ndarray:
    """Heading over time, rad, anticlockwise: from the middle of the rear wheels to the front's."""
    order = list(machine.blocks)
    front_right, front_left, back_right, back_left = (
        trajectory.positions[:, order.index(wheel)].astype(float) for wheel in _wheels(machine)
    )
    ahead = front_right + front_left - back_right - back_left
    return np.unwrap(np.arctan2(-ahead[:, 0], ahead[:, 1]))


@pytest.mark.parametrize(
    ("braked", "length", "track"),
    [((0,), 5, 1), ((1,), 5, 1), ((2,), 5, 1), ((3,), 5, 1), ((0,), 9, 1), ((3,), 7, 2)],
)
def test_a_car_with_a_braking_wheel_turns_and_travels_as_coulomb_says(
    engine, braked, length, track
) -> None:
    machine, held = _braked(braked, length, track)
    expected = planar_car(machine, held).drive(DURATION_S - STARTS_S)
    scenario = Scenario(duration_s=DURATION_S, control=Control(mode="agent"))
    trajectory = simulate(machine, scenario, engine)
    places = trajectory.positions[:, 0, :2].astype(float)
    travelled = np.linalg.norm(np.diff(places, axis=0), axis=1).sum()
    heading = _heading(machine, trajectory)
    assert travelled == pytest.approx(expected.travelled, rel=0.05)
    assert heading[-1] - heading[0] == pytest.approx(expected.turned, rel=0.05)


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
