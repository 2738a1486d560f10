"""Falling, bearing, climbing and tipping as worked out by hand."""

import math

import numpy as np
import pytest
from support.machines.building import KeyedDraft
from support.machines.families import beam, car
from support.machines.trials import gap_terrain

from buildarena_benchmark.experts.drafting import EAST, NORTH, SIDES, SOUTH, UP, WEST
from buildarena_geometry import Machine, load_catalogue
from buildarena_simulation import Scenario, Trajectory, simulate
from buildarena_simulation.constants import COLLISION_MARGIN, GRAVITY
from buildarena_simulation.scenario import Cargo, SpanPlacement, TerrainBox

BLOCK = load_catalogue()["Small Wooden Block"].physics


FRICTION_BLOCK, LINEAR_DRAG = BLOCK.friction, BLOCK.linear_drag


def _peak(trajectory: Trajectory, joint: str) -> tuple[float, float]:
    found = next(peak for peak in trajectory.joint_peaks if peak.joint == joint)
    return found.force, found.moment


def _slab() -> Machine:
    draft = KeyedDraft()
    middle = draft.start()
    for block in (middle, *draft.row(middle, EAST, 1), *draft.row(middle, WEST, 1)):
        draft.row(block, NORTH, 1)
        draft.row(block, SOUTH, 1)
    return draft.machine


@pytest.mark.parametrize("slope_deg", [20.0, 45.0])
def test_a_slab_stays_on_a_slope_below_the_friction_angle_and_slides_above(
    engine, slope_deg
) -> None:
    slope = math.radians(slope_deg)
    uphill = np.array([0.0, math.cos(slope), math.sin(slope)])
    top = 40.0 + 1.0 / math.cos(slope)  # of the slope, below the slab's middle
    lowest = top + 1.5 * math.tan(slope) + 0.5
    scenario = Scenario(
        duration_s=2.4,
        terrain=(TerrainBox(center=(0.0, 0.0, 40.0), size=(20.0, 60.0, 2.0), slope_deg=slope_deg),),
        placement=SpanPlacement(gap=1.0, lowest_center=lowest),
    )
    trajectory = simulate(_slab(), scenario, engine)
    along = trajectory.positions[:, 0].astype(float) @ uphill
    speeds = np.diff(along) * 25.0
    pull = GRAVITY * (FRICTION_BLOCK * math.cos(slope) - math.sin(slope))
    if pull > 0:
        assert np.abs(speeds[-10:]).max() < 0.01
        return
    late = speeds[40:]
    gained = np.polyfit(np.arange(len(late)) / 25.0, late, 1)[0]
    # Half-way the drag is about that of the mean speed.
    expected = pull - LINEAR_DRAG * late.mean()
    assert gained == pytest.approx(expected, abs=0.01 * GRAVITY)


def test_a_cantilever_bears_its_weight_at_the_root(engine) -> None:
    length = 4
    draft = KeyedDraft()
    middle = draft.start()
    for side in SIDES:  # a foot wide and heavy enough that nothing tips
        draft.row(middle, side, 4)
    top = draft.row(middle, UP, 2)[-1]
    arm = draft.row(top, EAST, length)
    trajectory = simulate(draft.machine, Scenario(duration_s=3.0), engine)
    assert not trajectory.breaks
    for k, (inner, outer) in enumerate(zip([top, *arm], arm, strict=False)):
        beyond = length - k
        force, moment = _peak(trajectory, f"{inner}-{outer}")
        # Joint k is half a unit inside block k + 1, whose weight is 0.3.
        assert force == pytest.approx(0.3 * beyond, rel=0.03)
        assert moment == pytest.approx(0.3 * beyond**2 / 2, rel=0.03)


def _bending_of_beam(engine: str, cargo_mass: float) -> dict[str, float]:
    scenario = Scenario(
        duration_s=5.0,
        terrain=gap_terrain(5.0),
        cargo=Cargo(
            size=(2.5, 2.5, 1.5),
            drop_height=0.03,  # slower than what counts as a landing
            final_mass=cargo_mass,
            ramp_start_s=1.0,
            ramp_s=1.0,
        ),
        placement=SpanPlacement(gap=5.0, lowest_center=5.5),
    )
    trajectory = simulate(beam(7), scenario, engine)
    assert not trajectory.breaks
    return {peak.joint: peak.moment for peak in trajectory.joint_peaks}


@pytest.mark.nightly(keep=1)
def test_a_beam_on_two_supports_bears_the_moments_of_statics(engine) -> None:
    load = 120.0
    light, half, full = (_bending_of_beam(engine, mass) for mass in (5.0, load / 2, load))
    # A beam that sags stands on the gap's edges, and the cargo presses evenly over its 2.5.
    # Moments about a joint, from one edge and the loads outside of the joint:
    edge, own = 2.5, 0.3
    reaction = load / 2 + 3 * own + 0.25 / 2
    expected = {
        "1-2": reaction * (edge - 0.5) - load / 2.5 * 0.75**2 / 2 - own * (0.5 + 1.5 + 2.5),
        "2-3": reaction * (edge - 1.5) - own * (0.5 + 1.5),
    }
    for joint, moment in expected.items():
        assert full[joint] == pytest.approx(moment, rel=0.02)
    # Symmetric halves bear the same, and loads superpose.
    assert full["1-5"] == pytest.approx(full["1-2"], rel=0.03)
    share = (load / 2 - 5.0) / (load - 5.0)
    for joint in expected:
        gained = half[joint] - light[joint]
        assert gained == pytest.approx(share * (full[joint] - light[joint]), rel=0.05)


def test_each_axle_of_a_standing_car_bears_its_share(engine) -> None:
    machine = car(drive=())
    trajectory = simulate(machine, Scenario(duration_s=2.0), engine)
    axles = {peak.joint: peak for peak in trajectory.joint_peaks if peak.kind == "axle"}
    assert len(axles) == 4
    share = (machine.mass - 4 * 1.0) / 4
    # Four supports are one too many for statics; opposite pairs bear half each.
    wheels = {name: machine.blocks[name.split("-")[1]].center_xyz for name in axles}
    for axis in (0, 1):
        for side in (-1, 1):
            pair = [axles[name] for name, center in wheels.items() if center[axis] * side > 0]
            assert sum(axle.force for axle in pair) == pytest.approx(2 * share, rel=0.03)
    for axle in axles.values():
        # The wheel's support stands a quarter of a unit off the face it sits on.
        assert axle.moment == pytest.approx(0.25 * axle.force, rel=0.35)


@pytest.mark.parametrize("mass", [5.0, 1500.0])
def test_no_cargo_mass_makes_an_intact_structure_jitter_or_sink(engine, mass) -> None:
    box = {"size": (2.5, 2.5, 1.5), "drop_height": 0.02, "initial_mass": mass / 2, "ramp_s": 1.0}
    scenario = Scenario(duration_s=4.0, cargo=Cargo(**box, final_mass=mass))
    trajectory = simulate(_slab(), scenario, engine)
    assert not trajectory.breaks
    height = trajectory.cargo_position[50:, 2].astype(float)
    assert np.ptp(height) < 0.005
    assert height.mean() == pytest.approx(1.75 - 2 * COLLISION_MARGIN, abs=0.06)


def test_a_cargo_falls_as_fast_however_it_grows(engine) -> None:
    machine = Machine()
    machine.act("start")
    for final in (5.0, 1000.0):
        cargo = Cargo(
            size=(2.5, 2.5, 1.5), drop_height=90, final_mass=final, ramp_start_s=0, ramp_s=2
        )
        rollout = simulate(machine, Scenario(duration_s=2, cargo=cargo), engine)
        assert rollout.cargo_position is not None
        fallen = rollout.cargo_position[0, 2] - rollout.cargo_position[:, 2]
        expected = 0.5 * GRAVITY * rollout.time_s**2
        assert fallen[-1] == pytest.approx(expected[-1], rel=0.03), final


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
