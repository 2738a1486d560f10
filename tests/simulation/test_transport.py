"""Vehicles: driving straight, turning on the spot, carrying."""

import numpy as np
import pytest
from support.machines.families import car
from support.machines.references import load_machine
from support.machines.trials import trial

from buildarena_simulation import Trajectory
from buildarena_simulation.engines.base import rotation_of

STRAIGHT = [("UpArrow", 1.0, 3.0)]


def _heading_deg(trajectory: Trajectory) -> float:
    forward = rotation_of(trajectory.quaternions[-1, 0].astype(float))[:, 1]
    return float(np.degrees(np.arctan2(-forward[0], forward[1])))


def test_a_four_wheeled_car_passes_and_moves_straight(engine, tasks) -> None:
    result, trajectory = trial(tasks["transport-1"], car(drive=STRAIGHT), engine, duration_s=5.0)
    assert result.success
    assert result.metrics["intact"] is True
    moved = trajectory.positions[-1, 0] - trajectory.positions[0, 0]
    assert abs(np.degrees(np.arctan2(moved[0], moved[1]))) < 5.0


def test_a_car_skid_steers(engine, tasks) -> None:
    cars = (car(3, 1, drive=[(key, 0.5, 0.4)]) for key in ("RightArrow", "LeftArrow"))
    right, left = (trial(tasks["transport-1"], one, engine, duration_s=1.4)[1] for one in cars)
    assert _heading_deg(right) < -30.0
    assert _heading_deg(left) == pytest.approx(-_heading_deg(right), abs=15.0)
    drift = np.linalg.norm(right.positions[-1, 0, :2] - right.positions[0, 0, :2])
    assert drift < 1.0


def test_a_wheel_brakes_when_its_key_is_released(engine, tasks) -> None:
    _, trajectory = trial(
        tasks["transport-1"], car(drive=[("UpArrow", 0.5, 1.5)]), engine, duration_s=4.0
    )
    north = trajectory.positions[:, 0, 1].astype(float)
    assert north[50] > 5.0
    assert abs(north[-1] - north[-10]) < 0.05


@pytest.mark.nightly(keep=2)
@pytest.mark.parametrize("rails", [True, False])
def test_a_cargo_stays_on_a_deck(engine, tasks, rails) -> None:
    actions = car(5, 2, deck_half=(2, 2), rails=rails, drive=[("UpArrow", 3.0, 3.0)])
    result, trajectory = trial(tasks["transport-2"], actions, engine, duration_s=8.0)
    assert result.success
    assert not trajectory.breaks
    assert trajectory.cargo_position is not None
    apart = trajectory.cargo_position[:, :2] - trajectory.positions[:, 0, :2]
    assert np.abs(apart[25:]).max() < 1.0


@pytest.mark.nightly(keep=1)
def test_the_large_cargo_stays_on_a_long_deck(engine, tasks) -> None:
    actions = car(9, 2, deck_half=(2, 4), drive=[("UpArrow", 3.0, 2.0), ("DownArrow", 5.5, 2.0)])
    result, trajectory = trial(tasks["transport-3"], actions, engine, duration_s=8.0)
    assert result.metrics["driven_distance"] > 10.0
    assert not result.success, "it goes north"
    assert trajectory.cargo_position is not None
    assert trajectory.cargo_position[-1, 2] > 1.5


@pytest.mark.nightly(keep=3)
@pytest.mark.parametrize(
    "machine", [car(bound=False), car(drive=()), load_machine("stool-with-wheels-on-top")]
)
def test_a_machine_nothing_drives_fails(engine, tasks, machine) -> None:
    result, _ = trial(tasks["transport-1"], machine, engine, duration_s=4.0)
    assert not result.success
    assert result.indicator < 1.0
