"""Drives of joints, sliders, springs, stops and cogs as worked out by hand."""

import math

import numpy as np
import pytest
from support.machines.rigs import Rig, catalogue, place_of, turned_by
from support.marks import nightly

from buildarena_benchmark.experts.drafting import DOWN, EAST, UP, WEST
from buildarena_simulation import Trajectory
from buildarena_simulation.constants import GRAVITY

RPM_100 = 100 * 2 * math.pi / 60


@pytest.mark.usefixtures("root")
def test_a_slider_falls_freely_to_its_stop(engine) -> None:
    rig = Rig()
    slider = rig.attach(rig.attach(rig.top, EAST), DOWN, "Slider")
    rig.row(slider, DOWN, 2)
    trajectory = rig.tried(engine, 2.0)
    way, base = place_of(trajectory, slider), place_of(trajectory, rig.top)
    fallen = way[0, 2] - way[:, 2]
    falling = (trajectory.time_s <= 0.2) & (trajectory.time_s >= 0.12)
    expected = GRAVITY * trajectory.time_s**2 / 2
    assert fallen[falling] == pytest.approx(expected[falling], rel=0.05)
    # The mast itself settles by the margin of its shape.
    drawn = fallen - (base[0, 2] - base[:, 2])
    assert drawn[-1] == pytest.approx(1.0, abs=0.02)
    assert drawn.max() < 1.1
    assert abs(way[:, :2] - way[0, :2]).max() < 0.02


@pytest.mark.usefixtures("root")
@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("weights", [1, 2])
def test_a_suspension_sags_and_swings_as_its_spring_and_damper_say(engine, weights) -> None:
    rig = Rig()
    leg = rig.attach(rig.top, UP, "Suspension")
    top = leg
    for _ in range(weights):
        top = rig.attach(top, UP, "Weight")
    joint = catalogue()["Suspension"].joint
    load = 0.5 + 10.0 * weights
    trajectory = rig.tried(engine, 6.0)
    height = (place_of(trajectory, top) - place_of(trajectory, rig.top))[:, 2]
    sag = min(load / joint.stiffness, 1.0)
    assert height[0] - height[-1] == pytest.approx(sag, rel=0.05)
    if sag < 0.6:
        rate = math.sqrt(joint.stiffness * GRAVITY / load)
        ratio = joint.damping * GRAVITY / (2 * load * rate)
        own = rate * math.sqrt(1 - ratio**2)
        t = trajectory.time_s
        ringing = np.exp(-ratio * rate * t) * (
            np.cos(own * t) + ratio * rate / own * np.sin(own * t)
        )
        expected = sag * (1 - ringing)
        assert height[0] - height == pytest.approx(expected, abs=0.05 * sag)


def test_a_piston_drives_out_and_back(engine) -> None:
    rig = Rig()
    piston = rig.bound(rig.attach(rig.top, UP, "Piston"), extend="Alpha1")
    rig.attach(piston, UP, "Weight")
    rig.press("Alpha1", 0.2, 1.2)
    trajectory = rig.tried(engine, 3.0)
    height = (place_of(trajectory, piston) - place_of(trajectory, rig.top))[:, 2]
    height -= height[0]
    drive = catalogue()["Piston"].joint.drive
    half = np.interp(0.2 + 0.5 / drive.rate, trajectory.time_s, height)
    assert half == pytest.approx(0.5, abs=0.06)
    assert height[33] == pytest.approx(1.0, abs=0.03)
    assert height[-1] == pytest.approx(0.0, abs=0.03)


@pytest.mark.parametrize(("weights", "lifted"), [(3, True), (5, False)])
def test_a_piston_lifts_no_more_than_its_force(engine: str, weights: int, *, lifted: bool) -> None:
    rig = Rig()
    piston = rig.bound(rig.attach(rig.top, UP, "Piston"), extend="Alpha1")
    top = piston
    for _ in range(weights):
        top = rig.attach(top, UP, "Weight")
    rig.press("Alpha1", 0.2, 3.0)
    trajectory = rig.tried(engine, 2.0)
    height = (place_of(trajectory, piston) - place_of(trajectory, rig.top))[:, 2]
    assert height[-1] - height[0] == pytest.approx(1.0 if lifted else 0.0, abs=0.03)


@pytest.mark.usefixtures("root")
@pytest.mark.parametrize(("key", "way"), [("LeftArrow", 1), nightly("RightArrow", -1)])
def test_a_steering_hinge_turns_to_its_limit_at_its_rate(engine, key, way) -> None:
    rig = Rig()
    # Its pin lies along the x axis of its face, which is west on the top face.
    hinge = rig.attach(rig.top, UP, "Steering Hinge")
    rig.bound(hinge, turn_left="LeftArrow", turn_right="RightArrow")
    rig.attach(hinge, UP)
    rig.press(key, 0.2, 0.3)
    rig.press(key, 1.2, 1.0)
    trajectory = rig.tried(engine, 3.0)
    pin = rig.machine.blocks[hinge].world_from_block.direction((1.0, 0.0, 0.0))
    axis = tuple(round(part) for part in pin)
    angle = np.degrees(turned_by(trajectory, hinge, axis))
    assert angle[25] == pytest.approx(way * 27.0, abs=1.5)
    assert angle[29] == pytest.approx(angle[22], abs=0.5)
    assert angle[-1] == pytest.approx(way * 40.0, abs=1.0)


@pytest.mark.usefixtures("root")
@pytest.mark.parametrize("flipped", [False, True])
def test_a_spinning_block_runs_without_a_key(engine: str, *, flipped: bool) -> None:
    rig = Rig()
    block = rig.attach(rig.top, UP, "Spinning Block")
    if flipped:
        rig.do("flip_spin", block_id=block)
    for side in (EAST, WEST):
        rig.row(block, side, 2)
    trajectory = rig.tried(engine, 2.0)
    speed = np.diff(turned_by(trajectory, block, (0, 0, 1))) * 25.0
    assert speed[-20:] == pytest.approx(RPM_100 if flipped else -RPM_100, rel=0.03)


def test_a_fly_wheel_turns_on_when_its_key_is_let_go(engine) -> None:
    rig = Rig()
    wheel = rig.bound(rig.attach(rig.top, UP, "Fly Wheel"), spinning_forward="UpArrow")
    rig.press("UpArrow", 0.2, 1.0)
    trajectory = rig.tried(engine, 3.0)
    speed = np.diff(turned_by(trajectory, wheel, (0, 0, 1))) * 25.0
    assert speed[:4] == pytest.approx(0.0, abs=0.01)
    assert speed[27] == pytest.approx(RPM_100, rel=0.03)
    drag = catalogue()["Fly Wheel"].physics.angular_drag
    assert speed[-1] == pytest.approx(speed[32] * math.exp(-drag * (73 - 32) / 25), rel=0.03)


MEDIUM, LARGE = "Cog Medium Unpowered", "Cog Large Unpowered"


def _pair(other: str, apart: int) -> tuple[Rig, str, str]:
    """A driven cog on the mast's top, and another on a beam so far east."""
    rig = Rig()
    motor = rig.bound(rig.attach(rig.top, UP, "Cog Medium Powered"), spinning_forward="UpArrow")
    cog = rig.attach(rig.row(rig.top, EAST, apart)[-1], UP, other)
    rig.press("UpArrow", 0.2, 10.0)
    return rig, motor, cog


def _speeds(trajectory: Trajectory, *blocks: str) -> list[np.ndarray]:
    return [np.diff(turned_by(trajectory, block, (0, 0, 1))) * 25.0 for block in blocks]


@pytest.mark.parametrize(("other", "apart", "ratio"), [(MEDIUM, 2, 1.0), (LARGE, 3, 0.5)])
def test_a_cog_turns_another_the_other_way_by_the_ratio_of_their_radii(
    engine, other, apart, ratio
) -> None:
    rig, motor, cog = _pair(other, apart)
    trajectory = rig.tried(engine, 2.0)
    driving, driven = _speeds(trajectory, motor, cog)
    assert driving[-20:] == pytest.approx(-RPM_100, rel=0.03)
    assert driven[-20:] == pytest.approx(ratio * RPM_100, rel=0.03)
    angle, other_angle = (turned_by(trajectory, block, (0, 0, 1)) for block in (motor, cog))
    assert other_angle == pytest.approx(-ratio * angle, abs=0.05)


@pytest.mark.parametrize(("weights", "lifted"), [(1, True), (2, False)])
def test_a_gear_lifts_by_its_ratio_what_its_motor_alone_could_not(
    engine: str, weights: int, *, lifted: bool
) -> None:
    rig = Rig()
    # Axes to the north: the motor's torque of 20 becomes 40 about the large cog's axis, where an
    # arm of 3 carries a weight of 10, or two.
    shaft = rig.row(rig.top, (0, 1, 0), 3)[-1]
    rig.bound(rig.attach(shaft, (0, 1, 0), "Cog Medium Powered"), spinning_backward="UpArrow")
    large = rig.attach(rig.row(shaft, EAST, 3)[-1], (0, 1, 0), LARGE)
    arm = rig.row(rig.attach(large, (0, 1, 0)), EAST, 2)[-1]
    for _ in range(weights):
        arm = rig.attach(arm, EAST, "Weight")
    rig.press("UpArrow", 0.0, 0.5)
    trajectory = rig.tried(engine, 0.4)
    rise = place_of(trajectory, arm)[-1, 2] - place_of(trajectory, arm)[0, 2]
    # It starts level; backward is counterclockwise seen from the north, and lifts the east.
    assert rise > 0.5 if lifted else rise < -0.5


def test_a_slider_on_its_side_stays_level_under_a_load_beside_it(engine) -> None:
    rig = Rig()
    slider = rig.attach(rig.top, EAST, "Slider")
    end = rig.row(slider, EAST, 3)[-1]
    trajectory = rig.tried(engine, 2.0)
    height = (place_of(trajectory, end) - place_of(trajectory, rig.top))[:, 2]
    assert abs(height - height[0]).max() < 0.02
