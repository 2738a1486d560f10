"""Hinges, balls, shafts, drives, sliders and stops as worked out by hand."""

import math

import numpy as np
import pytest
from support.machines.building import built
from support.machines.rigs import Rig, period_of, place_of, rotation_of, tried, turned_by
from support.marks import nightly

from buildarena_benchmark.experts.drafting import DOWN, EAST, NORTH, SOUTH, UP, WEST
from buildarena_geometry import module_set
from buildarena_simulation import Scenario, simulate
from buildarena_simulation.constants import GRAVITY
from buildarena_simulation.engines import base
from buildarena_simulation.scenario import Control, SpanPlacement, TerrainBox
from buildarena_simulation.structure.model import Structure


def _swinging(rig: Rig, joint: str) -> tuple[float, float, np.ndarray]:
    """Mass, inertia about the joint's middle (3, 3) and lever of what hangs by a joint."""
    structure, clusters = rig.bodies()
    block = structure.block_ids.index(joint)
    c = int(clusters.cluster_of[block])
    lever = clusters.center_of_mass[c] - structure.joints.points[block]
    mass = float(clusters.mass[c])
    inertia = clusters.inertia[c] + mass * (lever @ lever * np.eye(3) - np.outer(lever, lever))
    return mass, inertia, lever


@pytest.mark.usefixtures("root")
@pytest.mark.parametrize("name", ["Hinge", "Ball Joint"])
def test_a_pendulum_swings_in_its_time(engine, name) -> None:
    """On a hinge in the plane that its pin leaves free, on a ball in any."""
    rig = Rig()
    pin = rig.top if name == "Hinge" else rig.attach(rig.top, EAST)
    joint = rig.attach(pin, EAST if name == "Hinge" else DOWN, name)
    bob = rig.row(joint, DOWN, 3 if name == "Hinge" else 5)[-1]
    ways = [EAST] if name == "Hinge" else [EAST, NORTH]
    for way in ways:
        rig.attach(bob, way)
    mass, inertia, lever = _swinging(rig, joint)
    about = np.array([0.0, 1.0, 0.0] if name == "Hinge" else [1.0, -1.0, 0.0]) / len(ways) ** 0.5
    lasts = (
        2
        * math.pi
        * math.sqrt(
            float(about @ inertia @ about) / (mass * GRAVITY * float(np.linalg.norm(lever)))
        )
    )
    trajectory = rig.tried(engine, 5.0)
    path = place_of(trajectory, bob)[:, :2]
    swing = path @ np.sum(ways, axis=0)[:2]
    assert swing.max() - swing.min() > 0.5
    assert period_of(trajectory.time_s, swing) == pytest.approx(lasts, rel=0.03)
    assert name == "Ball Joint" or abs(path[:, 1]).max() < 0.01


@pytest.mark.usefixtures("root")
@pytest.mark.parametrize("side", [1, nightly(-1)])
def test_a_hinge_stops_at_a_right_angle(engine, side) -> None:
    rig = Rig()
    hinge = rig.attach(rig.top, UP, "Hinge")
    top = rig.row(hinge, UP, 2)[-1]
    # The pin lies along the hinge's own x axis, which is west here: it falls north or south.
    rig.attach(top, NORTH if side > 0 else SOUTH)
    trajectory = rig.tried(engine, 3.0)
    upwards = rotation_of(trajectory, hinge)[:, :, 2]
    angle = np.degrees(np.arctan2(upwards[:, 1], upwards[:, 2]))
    assert abs(angle).max() < 95.0
    assert angle[-1] == pytest.approx(side * 90.0, abs=2.0)


@pytest.mark.parametrize("name", ["Swivel", "Ball Joint"])
def test_a_cannon_turns_what_is_free_about_an_upright_axis(engine, name) -> None:
    rig = Rig()
    joint = rig.attach(rig.row(rig.top, EAST, 4)[-1], DOWN, name)
    hub = rig.attach(joint, DOWN)
    for side, spray in ((EAST, NORTH), (WEST, SOUTH)):
        rig.cannon(rig.row(hub, side, 2)[-1], side, spray)
    _, inertia, _ = _swinging(rig, joint)
    structure, _ = rig.bodies()
    axis = structure.joints.points[structure.block_ids.index(joint)]
    torque = _torque(structure, axis)
    scenario = Scenario(duration_s=0.6, control=Control(mode="constant", from_s=0.0))
    trajectory = tried(rig.machine, scenario, engine)
    angle = turned_by(trajectory, hub, (0, 0, 1))
    expected = torque / inertia[2, 2] * trajectory.time_s**2 / 2
    assert angle[-1] == pytest.approx(expected[-1], rel=0.03)


def _torque(structure: Structure, about: np.ndarray) -> float:
    arms = structure.thrust_points - about
    pushes = -structure.cold_thrusts[:, None] * structure.directions[structure.cannons] * GRAVITY
    return float(np.cross(arms, pushes)[:, 2].sum())


@pytest.mark.usefixtures("root")
def test_a_shaft_bent_by_thirty_degrees_turns_as_its_motor(engine) -> None:
    rig = Rig()
    wedge = rig.attach(rig.attach(rig.top, EAST), DOWN, "Wedge")
    rig.do("attach_block_to", base_block=wedge, face="A", new_block="Spinning Block")
    motor = list(rig.machine.blocks)[-1]
    for side in ("A", "B"):
        rig.do("attach_block_to", base_block=motor, face=side, new_block="Small Wooden Block")
    rig.do("attach_block_to", base_block=motor, face="E", new_block="Axle")
    axle = list(rig.machine.blocks)[-1]
    rig.do("attach_block_to", base_block=axle, face="A", new_block="Weight")
    trajectory = rig.tried(engine, 4.0)
    of_motor, of_shaft = rotation_of(trajectory, motor), rotation_of(trajectory, axle)
    start = of_motor[0].T @ of_shaft[0]
    bend = np.degrees(
        np.arccos(np.clip(np.einsum("ti,ti->t", of_motor[..., 2], of_shaft[..., 2]), -1, 1))
    )
    assert bend.max() > 50.0
    # Without twist the rotation that is left is about an axis across the shaft.
    left = np.transpose(of_motor, (0, 2, 1)) @ of_shaft @ start.T
    twist = np.degrees(np.arctan2(left[:, 1, 0] - left[:, 0, 1], left[:, 0, 0] + left[:, 1, 1]))
    assert abs(twist).max() < 1.0
    turns = np.diff(np.unwrap(np.arctan2(of_motor[:, 1, 0], of_motor[:, 0, 0])))
    assert abs(turns[25:].sum()) > 20.0


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("wheel", ["Wheel Unpowered", "Large Wheel Unpowered", "Fly Wheel"])
def test_a_cart_rolls_downhill_as_its_inertia_says(engine, wheel) -> None:
    rig = Rig()
    rig.machine = type(rig.machine)(catalogue=rig.machine.catalogue)
    middle = rig.start()
    ends = [rig.row(middle, NORTH, 3)[-1], rig.row(middle, SOUTH, 3)[-1]]
    wheels = [rig.attach(end, side, wheel) for end in ends for side in (EAST, WEST)]
    structure, clusters = rig.bodies()
    disc = int(clusters.cluster_of[structure.block_ids.index(wheels[0])])
    radius = rig.machine.blocks[wheels[0]].module.body[0].radius
    rolling = clusters.mass.sum() + 4 * clusters.inertia[disc][0, 0] / radius**2
    slope = math.radians(8.0)
    scenario = Scenario(
        duration_s=2.4,
        terrain=(TerrainBox(center=(0.0, 0.0, 40.0), size=(20.0, 400.0, 2.0), slope_deg=8.0),),
        placement=SpanPlacement(
            gap=1.0, lowest_center=40.0 + 1.0 / math.cos(slope) + 3.5 * math.tan(slope) + radius
        ),
        control=Control(mode="agent"),
    )
    trajectory = simulate(rig.machine, scenario, engine)
    downhill = np.array([0.0, -math.cos(slope), -math.sin(slope)])
    speed = np.diff(place_of(trajectory, middle) @ downhill) * 25.0
    rows = slice(30, 55)
    gained = np.polyfit(trajectory.time_s[1:][rows], speed[rows], 1)[0]
    drag = (clusters.linear_drag @ clusters.mass) * speed[rows].mean()
    expected = (clusters.mass.sum() * GRAVITY * math.sin(slope) - drag) / rolling
    assert gained == pytest.approx(expected, rel=0.05)


WAYS = {"<East>": (1, 0, 0), "<North>": (0, 1, 0), "<Up>": (0, 0, 1), "<Down>": (0, 0, -1)}


@pytest.mark.parametrize(("twist", "flip"), [(0, False), (90, False), (0, True)])
def test_a_steering_hinge_swings_where_it_is_said_to(engine, twist, flip) -> None:
    hinge = ("1", "A", "Steering Hinge")
    machine = built(hinge, catalogue=module_set("workshop"), init_shift=[0, 0, 20])
    assert machine.act("twist_block", {"block_id": "2", "angle": twist}).ok
    if flip:
        assert machine.act("flip_spin", {"block_id": "2"}).ok
    told = machine.act("get_block_details", {"block_id": "2"}).text
    way = told.partition("swings its far end ")[2].split(">")[0] + ">"
    side = np.array(WAYS.get(way, (0, -1, 0)))  # the only other one here is <South>
    key = {"block_id": "2", "action": "turn_right", "new_key": "RightArrow"}
    assert machine.act("change_control_key", key).ok
    press = {"time": 0, "key": "RightArrow", "hold_for": 1}
    assert machine.act("add_control_sequence", press).ok
    scenario = Scenario(duration_s=0.4, control=Control(mode="agent"))
    trajectory = simulate(machine, scenario, engine=engine, seed=0)
    start, hinge = (base.rotation_of(trajectory.quaternions[-1, i].astype(float)) for i in (0, 1))
    far_end = start.T @ hinge[:, 2]  # its own z axis, as the starting block has it
    assert far_end @ side > 0.2


def test_what_swings_freely_never_rises_above_its_start(engine) -> None:
    rig = Rig()
    first = rig.attach(rig.row(rig.top, NORTH, 2)[-1], NORTH, "Swivel")
    second = rig.attach(rig.row(first, EAST, 2)[-1], EAST, "Ball Joint")
    bob = rig.attach(rig.row(second, EAST, 2)[-1], EAST, "Weight")
    trajectory = rig.tried(engine, 8.0)
    height = place_of(trajectory, bob)[:, 2]
    assert height.min() < height[0] - 4.0
    assert height.max() < height[0] + 0.05
