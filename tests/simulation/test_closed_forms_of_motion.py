"""Launch, climb, brake, skid, tip, hang and spin as worked out by hand, on both engines."""

import math
from collections.abc import Sequence

import numpy as np
import pytest
from support.machines.drafts import KeyedDraft
from support.machines.families import car

from buildarena_geometry import Machine, load_catalogue
from buildarena_simulation import Scenario, Trajectory, simulate
from buildarena_simulation.constants import COLLISION_MARGIN, GRAVITY
from buildarena_simulation.machine import structure_of
from buildarena_simulation.scenario import Control, SpanPlacement, TerrainBox
from buildarena_simulation.structure.clusters import find_clusters
from buildarena_worker.builtin.designs.drafting import DOWN, EAST, NORTH, SOUTH, UP, WEST

CATALOGUE = load_catalogue()
WHEEL, BLOCK = CATALOGUE["Powered Wheel"], CATALOGUE["Small Wooden Block"]
GRIP = WHEEL.physics.friction * GRAVITY
DRAG = BLOCK.physics.linear_drag
DRIVEN = Control(mode="agent")


def _speeds(trajectory: Trajectory, way: Sequence[float] = (0.0, 1.0, 0.0)) -> np.ndarray:
    along = trajectory.positions[:, 0].astype(float) @ np.array(way)
    return np.diff(along) * 25.0


def _gain(speeds: np.ndarray, start_s: float, end_s: float) -> tuple[float, float]:
    """Acceleration between two times, by a straight line through the speeds, and mean speed."""
    rows = slice(round(start_s * 25), round(end_s * 25))
    time_s = np.arange(len(speeds))[rows] / 25.0
    return float(np.polyfit(time_s, speeds[rows], 1)[0]), float(speeds[rows].mean())


def test_a_car_whose_wheels_spin_starts_as_friction_says(engine) -> None:
    machine = car(drive=[("UpArrow", 0.5, 10.0)])
    speeds = _speeds(simulate(machine, Scenario(duration_s=1.2, control=DRIVEN), engine))
    gained, mean = _gain(speeds, 0.64, 0.92)
    assert gained == pytest.approx(GRIP - DRAG * mean, rel=0.03)


def test_a_car_that_brakes_skids_to_rest_as_friction_says(engine) -> None:
    machine = car(drive=[("UpArrow", 0.5, 2.0)])
    trajectory = simulate(machine, Scenario(duration_s=4.0, control=DRIVEN), engine)
    speeds = _speeds(trajectory)
    lost, mean = _gain(speeds, 2.64, 2.88)
    assert lost == pytest.approx(-GRIP - DRAG * mean, rel=0.03)
    assert abs(speeds[-5:]).max() < 0.01


@pytest.mark.parametrize("slope_deg", [25.0, 29.0])
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


def _leaning(arm: int, height: int) -> Machine:
    """A foot three wide with a column on it and an arm to the east on top."""
    draft = KeyedDraft()
    middle = draft.start()
    for side in (EAST, WEST, NORTH, SOUTH):
        draft.row(middle, side, 1)
    top = draft.row(middle, UP, height)[-1]
    draft.row(top, EAST, arm)
    return draft.machine


def test_a_machine_tips_when_its_weight_leaves_its_foot(engine) -> None:
    edge = 1.5 - COLLISION_MARGIN
    shares = {
        (arm, height): float(_leaning(arm, height).center_of_mass[0]) / edge
        for arm in range(3, 9)
        for height in range(2, 14)
    }
    inside = max((pair for pair in shares if shares[pair] < 1.0), key=lambda p: shares[p])
    outside = min((pair for pair in shares if shares[pair] > 1.0), key=lambda p: shares[p])
    assert shares[inside] > 0.97
    assert shares[outside] < 1.03
    for pair, falls in ((inside, False), (outside, True)):
        trajectory = simulate(_leaning(*pair), Scenario(duration_s=8.0), engine)
        drop = trajectory.positions[0, :, 2].max() - trajectory.positions[-1, :, 2].max()
        assert (drop > 1.0) == falls


def test_a_rope_bears_what_hangs_on_it(engine) -> None:
    draft = KeyedDraft()
    middle = draft.start()
    for side in (EAST, WEST, NORTH, SOUTH):
        draft.row(middle, side, 4)
    top = draft.row(middle, UP, 8)[-1]
    tip = draft.row(top, EAST, 3)[-1]
    load = draft.attach(tip, DOWN)
    for _ in range(4):
        draft.do("shift_block", block_id=load, shift_real=[0.0, 0.0, -0.5])
    below = draft.row(load, DOWN, 2)
    draft.connect(tip, load, DOWN, UP, connector="Winch")
    weight = 0.3 * (1 + len(below)) + 0.2
    trajectory = simulate(draft.machine, Scenario(duration_s=4.0), engine)
    rope = next(peak for peak in trajectory.joint_peaks if peak.kind == "rope")
    assert rope.force == pytest.approx(weight, rel=0.03)


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
        control=Control(mode="held", from_s=0.0),
    )
    trajectory = simulate(machine, scenario, engine)
    apart = (trajectory.positions[:, 1] - trajectory.positions[:, 0]).astype(float)
    angle = np.unwrap(np.arctan2(-apart[:, 2], -apart[:, 0]))
    expected = np.linalg.norm(acceleration) * trajectory.time_s**2 / 2
    assert abs(angle[-1] - angle[0]) == pytest.approx(expected[-1], rel=0.03)
