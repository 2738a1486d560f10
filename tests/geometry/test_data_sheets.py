"""What decides a design is told, from the module files themselves."""

import math
import re

import pytest

from buildarena_geometry import Catalogue, Machine, module_set
from buildarena_geometry.feedback.data_sheets import data_sheet
from buildarena_geometry.feedback.modules import modules_text
from buildarena_geometry.feedback.words import number, plain, point

WORKSHOP = module_set("workshop")
NAMES = list(WORKSHOP)


def sheet(name: str) -> str:
    return data_sheet(WORKSHOP[name], WORKSHOP.start.physics)


def figures(module) -> list[str]:
    """Every figure of a module's entry that decides what it does, as a sheet writes it."""
    told = [point(face.center) for face in module.faces]
    motor, joint, push, wing = module.motor, module.joint, module.push, module.wing
    if motor is not None:
        told += [f"{plain(motor.speed_rpm)} rpm", number(motor.speed), plain(motor.torque)]
    if joint is not None:
        told += [
            plain(value) for value in (joint.friction, joint.stiffness, joint.damping) if value
        ]
        turns = module.physics.joint_type != "slider"
        told += [number(abs(math.degrees(x) if turns else x)) for x in joint.limits or ()]
        if joint.point is not None:
            told.append(point(joint.point))
    if joint is not None and joint.drive is not None:
        told += [number(joint.drive.rate), plain(joint.drive.force)]
    if module.gear is not None:
        told.append(f"pitch radius {plain(module.gear.pitch_radius)}")
    if module.thrust is not None:
        told += [plain(module.thrust.cold), plain(module.thrust.heated)]
    if push is not None:
        told += [plain(push.force), point(push.direction)]
    if wing is not None:
        told += [plain(wing.coefficient), plain(wing.cap_speed), point(wing.normal)]
    for part, names in (
        ("lift", ["force"]),
        ("altitude", ["most", "stiffness", "damping", "rate"]),
        ("rope_mount", ["length"]),
        ("spring", ["stiffness", "damping", "shortest", "rate", "limit"]),
        ("decouple", ["impulse"]),
        ("grip", ["reach", "force", "moment"]),
    ):
        force = getattr(module, part)
        told += [plain(getattr(force, name)) for name in names] if force is not None else []
    return told


@pytest.mark.parametrize("name", NAMES)
def test_a_sheet_has_every_figure_of_its_module_in_one_line(name):
    text = sheet(name)
    assert "\n" not in text
    for figure in figures(WORKSHOP[name]):
        assert figure in text, figure


@pytest.mark.parametrize("name", NAMES)
def test_friction_and_drag_are_told_where_they_are_unusual(name):
    physics, usual = WORKSHOP[name].physics, WORKSHOP.start.physics
    if physics is None:
        return
    text = sheet(name)
    assert ("friction" in re.sub("dry friction", "", text)) == (physics.friction != usual.friction)
    assert ("drag" in text) == (physics.linear_drag != usual.linear_drag)
    alone = data_sheet(WORKSHOP[name], None)
    assert f"friction {plain(physics.friction)}" in alone


def test_figures_are_the_modules_own():
    """Another figure in the file is another figure in the line."""
    from msgspec.structs import replace

    cog = WORKSHOP["Cog Large Unpowered"]
    wider = replace(cog, gear=replace(cog.gear, pitch_radius=2.75))
    assert "pitch radius 2.75" in data_sheet(wider, None)
    wheel = WORKSHOP["Powered Wheel"]
    slower = replace(wheel, motor=replace(wheel.motor, speed_rpm=77.0, torque=13.5))
    assert "77 rpm (8.06 rad/s" in data_sheet(slower, None)
    assert "torque and brake up to 13.5" in data_sheet(slower, None)


@pytest.mark.parametrize("name", [name for name in NAMES if WORKSHOP[name].gear])
def test_a_cog_says_the_radius_that_it_meshes_at_and_no_other(name):
    cog = WORKSHOP[name]
    for text in (cog.description, cog.brief):
        assert {float(r) for r in re.findall(r"radius ([\d.]*\d)", text)} == {cog.gear.pitch_radius}


def test_lists_have_data_only_where_they_are_told():
    plain_list = modules_text(WORKSHOP).splitlines()
    told = modules_text(WORKSHOP.with_data_sheets()).splitlines()
    assert not any("Data:" in line for line in plain_list)
    assert len(plain_list) == len(WORKSHOP)
    with_data = [name for name in NAMES if sheet(name)]
    assert sum(line.startswith("  Data: ") for line in told) == len(with_data)
    assert len(told) == len(WORKSHOP) + len(with_data)


def test_who_looks_a_module_up_reads_its_data_where_they_are_told():
    for catalogue in (WORKSHOP, WORKSHOP.with_data_sheets()):
        machine = Machine(catalogue=catalogue)
        answer = machine.act("describe_module", {"module": "Steering Hinge"}).text
        assert ("torque up to 40" in answer) == catalogue.data_sheets


def test_a_catalogue_with_data_sheets_has_the_same_modules():
    told = WORKSHOP.with_data_sheets()
    assert dict(told) == dict(WORKSHOP)
    assert told is WORKSHOP.with_data_sheets() is told.with_data_sheets()
    assert isinstance(told, Catalogue)
    assert not WORKSHOP.data_sheets
