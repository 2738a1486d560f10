"""Cars and rockets as friction, motors and thrust say."""

import math
from collections.abc import Sequence

import numpy as np
import pytest
from support.machines.building import KeyedDraft
from support.machines.families import car, rocket
from support.machines.trials import trial
from support.marks import nightly

from buildarena_benchmark.experts.drafting import EAST, UP, WEST
from buildarena_geometry import Machine, load_catalogue
from buildarena_simulation import Scenario, Trajectory, simulate
from buildarena_simulation.constants import GRAVITY
from buildarena_simulation.machine import structure_of
from buildarena_simulation.scenario import Control, SpanPlacement, TerrainBox
from buildarena_simulation.structure.clusters import find_clusters

CATALOGUE = load_catalogue()


WHEEL, WOOD = CATALOGUE["Powered Wheel"], CATALOGUE["Small Wooden Block"]


GRIP = WHEEL.physics.friction * GRAVITY


DRAG = WOOD.physics.linear_drag


DRIVEN = Control(mode="agent")


def _speeds(trajectory: Trajectory, way: Sequence[float] = (0.0, 1.0, 0.0)) -> np.ndarray:
    along = trajectory.positions[:, 0].astype(float) @ np.array(way)
    return np.diff(along) * 25.0


def _gain(speeds: np.ndarray, start_s: float, end_s: float) -> tuple[float, float]:
    """Acceleration between two times, by a straight line through the speeds, and mean speed."""
    rows = slice(round(start_s * 25), round(end_s * 25))
    time_s = np.arange(len(speeds))[rows] / 25.0
    return float(np.polyfit(time_s, speeds[rows], 1)[0]), float(speeds[rows].mean())


def test_a_car_starts_and_skids_to_rest_as_friction_says_and_rolls_without_slip(engine) -> None:
    machine = car(drive=[("UpArrow", 0.5, 2.0)])
    speeds = _speeds(simulate(machine, Scenario(duration_s=4.0, control=DRIVEN), engine))
    gained, mean = _gain(speeds, 0.64, 0.92)
    assert gained == pytest.approx(GRIP - DRAG * mean, rel=0.03)
    assert speeds[55:60].mean() == pytest.approx(WHEEL.motor.speed, rel=0.02)
    lost, mean = _gain(speeds, 2.64, 2.88)
    assert lost == pytest.approx(-GRIP - DRAG * mean, rel=0.03)
    assert abs(speeds[-5:]).max() < 0.01


@pytest.mark.parametrize("slope_deg", [25.0, nightly(29.0)])
def test_a_car_climbs_as_friction_and_slope_say(engine, slope_deg) -> None:
    slope = math.radians(slope_deg)
    machine = car(drive=[("UpArrow", 0.0, 10.0)])
    # A car of seven blocks is set down above a slope whose middle is 40 high.
    lowest = 40.0 + 1.0 / math.cos(slope) + 3.5 * math.tan(slope) + 1.3
    scenario = Scenario(
        duration_s=4.0,
        terrain=(
            TerrainBox(center=(0.0, 0.0, 40.0), size=(20.0, 400.0, 2.0), slope_deg=slope_deg),
        ),
        placement=SpanPlacement(gap=1.0, lowest_center=lowest),
        control=DRIVEN,
    )
    uphill = (0.0, math.cos(slope), math.sin(slope))
    speeds = _speeds(simulate(machine, scenario, engine), uphill)
    slipping = np.flatnonzero(speeds < 0.6 * WHEEL.motor.speed)
    rows = slipping[slipping > 25]
    gained, mean = _gain(speeds, rows[0] / 25, rows[-1] / 25)
    expected = GRIP * math.cos(slope) - GRAVITY * math.sin(slope) - DRAG * mean
    assert gained == pytest.approx(expected, abs=0.03 * GRIP)


def test_a_cannon_off_the_centre_turns_a_machine_as_its_inertia_says(engine) -> None:
    draft = KeyedDraft()
    middle = draft.start()
    draft.row(middle, WEST, 3)
    draft.cannon(draft.row(middle, EAST, 3)[-1], EAST, UP)
    machine = draft.machine
    structure = structure_of(machine)
    clusters = find_clusters(structure, np.ones(len(structure.members), dtype=bool))
    arm = structure.thrust_points[0] - clusters.center_of_mass[0]
    torque = np.cross(arm, -structure.directions[structure.cannons[0]])
    torque = torque * structure.cold_thrusts[0] * GRAVITY
    acceleration = np.linalg.solve(clusters.inertia[0], torque)
    scenario = Scenario(
        duration_s=0.4,
        placement=SpanPlacement(gap=1.0, lowest_center=30.0),
        control=Control(mode="constant", from_s=0.0),
    )
    trajectory = simulate(machine, scenario, engine)
    apart = (trajectory.positions[:, 1] - trajectory.positions[:, 0]).astype(float)
    angle = np.unwrap(np.arctan2(-apart[:, 2], -apart[:, 0]))
    expected = np.linalg.norm(acceleration) * trajectory.time_s**2 / 2
    assert abs(angle[-1] - angle[0]) == pytest.approx(expected[-1], rel=0.03)


STARTS_S, DURATION_S = 0.48, 4.48


def _wheels(machine: Machine) -> list[str]:
    return [b.id for b in machine.blocks.values() if b.module.name == "Powered Wheel"]


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


@pytest.mark.nightly(keep=2)
@pytest.mark.parametrize(
    ("braked", "size", "path"),
    [
        (0, (5, 1), (36.91, -0.45)),
        (1, (5, 1), (36.91, 0.45)),
        (3, (5, 1), (34.40, 1.098)),
        (0, (9, 1), (36.45, -0.169)),
        (3, (7, 2), (34.69, 0.657)),
    ],
)
def test_a_car_with_a_braking_wheel_turns_and_travels_as_coulomb_says(
    engine, braked, size, path
) -> None:
    """The path integrates friction against the slip of each wheel of a rigid car in the plane."""
    machine = car(*size, drive=[("UpArrow", STARTS_S, 20.0)])
    for action, key in (("forward", "Alpha1"), ("backward", "Alpha2")):
        wheel = _wheels(machine)[braked]
        told = {"block_id": wheel, "action": f"spinning_{action}", "new_key": key}
        assert machine.act("change_control_key", told).ok
    assert _driven(machine, engine) == pytest.approx(path, rel=0.05)


def test_a_heated_engine_lifts_itself_and_a_cold_one_does_not(engine, tasks) -> None:
    heated, _ = trial(tasks["lift-1"], rocket(), engine)
    cold, _ = trial(tasks["lift-1"], rocket(heated=False), engine)
    assert heated.success
    assert heated.indicator > 5.0
    assert heated.metrics["heated_cannons"] == 4
    assert not cold.success
    assert 0.0 < cold.indicator < 1.0


def test_a_rocket_climbs_as_thrust_weight_and_drag_say(engine) -> None:
    machine = rocket()
    scenario = Scenario(duration_s=7.0, control=Control(mode="constant", from_s=2.0))
    trajectory = simulate(machine, scenario, engine)
    height = trajectory.positions[:, 0, 2].astype(float)
    rise = height - height[50]
    t = trajectory.time_s - 2.0
    acceleration = 4 * CATALOGUE["Water Cannon"].thrust.heated / machine.mass * GRAVITY - GRAVITY
    # Wooden and iron blocks all have the same drag, so the whole rocket has it too.
    climbed = acceleration / DRAG * (t - (1 - np.exp(-DRAG * t)) / DRAG)
    for second in (1, 2, 3, 4, 5):
        sample = 50 + 25 * second
        assert rise[sample] == pytest.approx(climbed[sample], rel=0.03)
