"""A trial that starts at an exact place of the caller's own."""

import json

import numpy as np
import pytest

from buildarena_simulation import MachineNotSimulable, Scenario, simulate
from buildarena_simulation.engines.base import CargoBox, rotation_of
from buildarena_simulation.machine import structure_of
from buildarena_simulation.placement import Start, start_of
from buildarena_simulation.scenario import Cargo

QUARTER = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
SHORT = Scenario(duration_s=0.4)
LOADED = Scenario(duration_s=0.4, cargo=Cargo(size=(1, 1, 1), final_mass=6, ramp_s=1))


def test_the_scenarios_own_place_given_as_a_start_changes_nothing(beam, engine) -> None:
    there = start_of(structure_of(beam), LOADED)
    given = simulate(beam, LOADED, engine, start=there)
    usual = simulate(beam, LOADED, engine)
    assert np.array_equal(given.positions, usual.positions)
    assert np.array_equal(given.quaternions, usual.quaternions)
    assert given.cargo_position is not None
    assert usual.cargo_position is not None
    assert np.array_equal(given.cargo_position, usual.cargo_position)


def test_machine_and_cargo_start_where_they_are_put(beam, engine) -> None:
    box = CargoBox(size=np.ones(3), position=np.array([40.0, 2.0, 9.0]), mass=5.0)
    start = Start(position=np.array([7.0, -3.0, 6.0]), rotation=QUARTER, cargo=box)
    trajectory = simulate(beam, LOADED, engine, start=start)
    assert np.allclose(trajectory.positions[0], [[7, -3, 6], [6, -3, 6]], atol=1e-4)
    assert trajectory.cargo_position is not None
    assert np.allclose(trajectory.cargo_position[0], [40, 2, 9], atol=1e-4)
    fall = trajectory.positions[0, :, 2] - trajectory.positions[-1, :, 2]
    assert (fall > 1).all()  # nothing holds it up there


def test_the_settings_tell_one_start_from_another(beam) -> None:
    high = [
        Start(position=np.array([0.0, 0.0, z]), rotation=np.eye(3), cargo=None) for z in (2, 2, 3)
    ]
    first, same, other = (
        simulate(beam, SHORT, "mujoco", start=start).settings["start"] for start in high
    )
    assert first == same != other
    assert "start" not in simulate(beam, SHORT, "mujoco").settings
    json.dumps(first)


@pytest.mark.parametrize(
    ("scenario", "cargo", "seed", "message"),
    [
        (SHORT, None, 3, "a seed varies it"),
        (LOADED, None, None, "the start has no cargo"),
        (
            SHORT,
            CargoBox(size=np.ones(3), position=np.zeros(3), mass=1.0),
            None,
            "the scenario has no cargo",
        ),
    ],
)
def test_a_start_that_contradicts_the_rest_is_refused(beam, scenario, cargo, seed, message) -> None:
    start = Start(position=np.zeros(3), rotation=np.eye(3), cargo=cargo)
    with pytest.raises(ValueError, match=message):
        simulate(beam, scenario, "mujoco", start=start, seed=seed)


@pytest.mark.parametrize("heading", [30.0, -90.0])
def test_a_cargo_starts_turned_from_north_towards_east(beam, engine, heading) -> None:
    cargo = LOADED.cargo.model_copy(update={"at": (8.0, 0.0, 0.0), "heading_deg": heading})
    scenario = LOADED.model_copy(update={"cargo": cargo})
    trajectory = simulate(beam, scenario, engine)
    north = rotation_of(trajectory.cargo_quaternion.astype(float))[:, :, 1]
    expected = [np.sin(np.radians(heading)), np.cos(np.radians(heading)), 0.0]
    assert np.allclose(north[0], expected, atol=1e-3)
    assert np.allclose(north[-1], expected, atol=1e-2)


def test_a_cargo_that_is_turned_is_in_the_way_where_it_is_turned_to(beam) -> None:
    """A long box beside the machine, which it reaches once it lies across."""
    long = Cargo(size=(1, 8, 1), final_mass=1.0, ramp_s=1.0, at=(3, 0, 0))
    for heading, clear in ((0.0, True), (90.0, False)):
        cargo = long.model_copy(update={"heading_deg": heading})
        scenario = Scenario(duration_s=0.2, cargo=cargo, clear_start=True)
        if clear:
            simulate(beam, scenario, "mujoco")
        else:
            with pytest.raises(MachineNotSimulable, match="overlaps the cargo"):
                simulate(beam, scenario, "mujoco")
