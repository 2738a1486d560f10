"""Cogs turn each other by the ratio of their radii, on both engines."""

import math

import numpy as np
import pytest
from support.machines.rigs import Rig, catalogue, place_of, turned_by

from buildarena_simulation import Trajectory
from buildarena_worker.builtin.designs.drafting import EAST, UP

RPM_100 = 100 * 2 * math.pi / 60
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


@pytest.mark.usefixtures("root")
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


@pytest.mark.parametrize("apart", [3, 4])
def test_cogs_that_do_not_touch_leave_each_other_alone(engine, apart) -> None:
    rig, motor, cog = _pair(MEDIUM, apart)
    driving, driven = _speeds(rig.tried(engine, 1.2), motor, cog)
    assert driving[-1] == pytest.approx(-RPM_100, rel=0.03)
    assert abs(driven).max() < 0.01


def test_cogs_on_different_levels_leave_each_other_alone(engine) -> None:
    rig = Rig()
    motor = rig.bound(rig.attach(rig.top, UP, "Cog Medium Powered"), spinning_forward="UpArrow")
    base = rig.row(rig.top, EAST, 2)[-1]
    cog = rig.attach(rig.attach(base, UP), UP, MEDIUM)
    rig.press("UpArrow", 0.0, 10.0)
    driving, driven = _speeds(rig.tried(engine, 1.2), motor, cog)
    assert driving[-1] == pytest.approx(-RPM_100, rel=0.03)
    assert abs(driven).max() < 0.01


def test_a_row_of_cogs_turns_by_turns(engine) -> None:
    rig = Rig()
    motor = rig.bound(rig.attach(rig.top, UP, "Cog Medium Powered"), spinning_forward="UpArrow")
    row = rig.row(rig.top, EAST, 4)
    second, third = (rig.attach(row[k], UP, MEDIUM) for k in (1, 3))
    rig.press("UpArrow", 0.0, 10.0)
    speeds = [speed[-1] for speed in _speeds(rig.tried(engine, 1.6), motor, second, third)]
    assert speeds == pytest.approx([-RPM_100, RPM_100, -RPM_100], rel=0.03)


@pytest.mark.usefixtures("root")
def test_a_cog_that_is_held_stalls_the_other(engine) -> None:
    rig, motor, cog = _pair(MEDIUM, 2)
    arm = rig.attach(cog, UP)
    rig.connect(arm, rig.attach(rig.top, (0, 1, 0)), EAST, EAST)
    driving, driven = _speeds(rig.tried(engine, 1.2), motor, cog)
    assert abs(driving).max() < 0.02
    assert abs(driven).max() < 0.02


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


def test_pitch_radii_are_in_proportion_to_the_teeth() -> None:
    modules = catalogue()
    radii = {name: modules[name].gear.pitch_radius for name in (MEDIUM, LARGE)}
    assert radii[LARGE] / radii[MEDIUM] == 16 / 8
    assert modules["Cog Medium Powered"].gear.pitch_radius == radii[MEDIUM]
