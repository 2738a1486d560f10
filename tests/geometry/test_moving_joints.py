"""What module files say of joints, drives and teeth, and how senseless ones are refused."""

import math

import pytest
from support.machines.building import BLOCK, built
from support.machines.module_files import like, module_file

from buildarena_geometry import load_catalogue, module_set
from buildarena_geometry.errors import CatalogueError
from buildarena_geometry.modules.joints import MOVING_JOINTS

SERVO = {"kind": "position", "rate": 90, "force": 20, "forward": "left", "backward": "right"}


def _loaded(tmp_path, seat, *, actions=("left", "right"), **fields):
    module = like(BLOCK, "Part", actions=list(actions), **fields)
    module["physics"]["joint_type"] = seat
    return load_catalogue(module_file(tmp_path, module))["Part"]


def test_angles_are_degrees_in_files_and_radians_inside(tmp_path):
    joint = {"axis": [1, 0, 0], "limits": [-90, 45], "drive": {**SERVO, "default_mode": "return"}}
    found = _loaded(tmp_path, "hinge", joint=joint).joint
    assert found.limits == pytest.approx((-math.pi / 2, math.pi / 4))
    assert found.drive.rate == pytest.approx(math.pi / 2)
    assert found.axis == (1, 0, 0)
    assert found.point is None


def test_a_slider_counts_in_units(tmp_path):
    drive = {"kind": "position", "rate": 2, "force": 40, "forward": "left"}
    found = _loaded(tmp_path, "slider", joint={"limits": [0, 1.5], "drive": drive}).joint
    assert found.limits == (0.0, 1.5)
    assert found.drive.rate == 2.0


SPEED = {"kind": "speed", "rate": 600, "force": 20}
SENSELESS = [
    ("attachment", {"joint": {}}, "joint: expected no joint: only one of the joint types axle"),
    ("mount", {"joint": {}}, "moves, found 'mount'"),
    ("hinge", {"gear": {"pitch_radius": 1}}, "no gear: a cog's joint type is axle, not hinge"),
    ("axle", {"joint": {}, "gear": {"pitch_radius": 0}}, "pitch_radius: expected a number above 0"),
    ("axle", {}, "the joint type axle needs either a motor or a joint"),
    ("hinge", {"joint": {"axis": [1, 1, 0]}}, "axis: expected a direction"),
    ("hinge", {"joint": {"limits": [10, 40]}}, "limits: expected two numbers, the first at most 0"),
    ("hinge", {"joint": {"limits": [0, 0]}}, "limits: expected two numbers"),
    ("hinge", {"joint": {"limits": [-180, 90]}}, "two angles between -180 and 180 degrees"),
    ("hinge", {"joint": {"limits": [-10]}}, "limits: expected a list of length 2"),
    ("ball", {"joint": {"limits": [-10, 10]}}, "no limits: one of the joint types hinge, slider"),
    ("constant_velocity", {"joint": {"limits": [-10, 20]}}, "two opposite angles up to 150"),
    ("constant_velocity", {"joint": {"limits": [-160, 160]}}, "two opposite angles up to 150"),
    ("hinge", {"joint": {"friction": -1}}, "friction: expected a number of at least 0"),
    ("hinge", {"joint": {"friction": 1, "stiffness": 1}}, "no spring and no damper"),
    ("ball", {"joint": {"damping": 1}}, "no spring and no damper: only a hinge or slider"),
    ("ball", {"joint": {"drive": SERVO}}, "no drive: it moves one of the joint types axle, hinge"),
    ("hinge", {"joint": {"friction": 1, "drive": SERVO}}, "without a spring, a damper or friction"),
    ("hinge", {"joint": {"drive": {**SERVO, "default_mode": "free"}}}, "expected hold or return"),
    ("hinge", {"joint": {"drive": {**SPEED, "default_mode": "return"}}}, "expected hold, free or"),
    ("hinge", {"joint": {"drive": SPEED}}, "forward: expected an action"),
    (
        "hinge",
        {"joint": {"drive": {**SPEED, "default_mode": "forward", "forward": "left"}}},
        "none where it runs forward all the time",
    ),
    ("hinge", {"joint": {"drive": {**SERVO, "forward": "up"}}}, "forward: expected one of left"),
    ("hinge", {"joint": {"drive": {**SERVO, "force": 0}}}, "force: expected a number above 0"),
    ("hinge", {"joint": {"drive": {**SERVO, "kind": "pull"}}}, "expected one of position, speed"),
    (
        "slider",
        {"joint": {"drive": {**SERVO, "forward_sense": "clockwise"}}},
        "no sense: a slider does not turn",
    ),
    ("hinge", {"joint": {"colour": "red"}}, "there is no field 'colour'; the fields are axis"),
]


@pytest.mark.parametrize(("seat", "fields", "message"), SENSELESS)
def test_senseless_joints_are_refused_with_what_belongs_there(tmp_path, seat, fields, message):
    with pytest.raises(CatalogueError, match=message):
        _loaded(tmp_path, seat, **fields)


def test_every_joint_of_the_workshop_says_where_its_figures_come_from():
    moving = [
        m
        for m in module_set("workshop").values()
        if m.physics and m.physics.joint_type in MOVING_JOINTS
    ]
    assert len(moving) >= 19
    for module in moving:
        if module.motor is None:
            origins = [module.joint.origin]
            if module.joint.drive is not None:
                origins.append(module.joint.drive.origin)
            assert any(origins), module.name
            for origin in filter(None, origins):
                assert any(word in origin for word in ("known", "community", "chosen")), module.name


@pytest.mark.parametrize("name", ["Steering Hinge", "Steering Block", "Spinning Block"])
def test_driven_joints_can_be_flipped_and_passive_ones_cannot(name):
    machine = built(("1", "A", name), ("1", "B", "Hinge"), catalogue=module_set("workshop"))
    before = machine.blocks["2"].forward_is_clockwise
    assert machine.act("flip_spin", {"block_id": "2"}).ok
    assert machine.blocks["2"].forward_is_clockwise != before
    assert not machine.act("flip_spin", {"block_id": "3"}).ok
