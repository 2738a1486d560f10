"""Module files: what an entry says, and how a senseless one is refused."""

import copy
import json
import math

import jsonschema
import pytest
import yaml
from support.machines.building import BLOCK, attach, built, connect
from support.machines.module_files import FILES, SCHEMA, entries, like, module_file

from buildarena_geometry import CatalogueError, Machine, RefusalClass, load_catalogue, module_set
from buildarena_geometry.modules.forces import FORCE_FIELDS

BASIC = json.loads(FILES.joinpath("modules.yaml").read_text())
FURTHER = entries("extended.yaml")
CRATE = {
    "name": "Crate",
    "kind": "block",
    "mass": 4,
    "cost": 2,
    "size": [4, 4, 4],
    "center": [0, 0, 2],
    "faces": [{"label": "E", "center": [0, 0, 4], "normal": [0, 0, 1], "x_axis": [1, 0, 0]}],
    "colliders": [{"shape": "box", "from": [-1.9, -1.9, 0.1], "to": [1.9, 1.9, 3.9]}],
    "body": [{"shape": "box", "from": [-2, -2, 0], "to": [2, 2, 4]}],
    "description": "A large crate.",
    "besiege": {"id": 15, "data": []},
}


def test_the_file_is_yaml_and_json_alike_and_fits_its_schema():
    assert yaml.safe_load(FILES.joinpath("modules.yaml").read_text()) == BASIC
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    jsonschema.validate(BASIC, SCHEMA)


def test_a_file_without_them_gives_a_module_what_its_kind_does(tmp_path, subtests):
    for name in ["Small Wooden Block", "Powered Wheel", "Water Cannon", "Torch"]:
        with subtests.test(name=name):
            new = {"motor", "thrust", "physics", "grabs"}
            entry = next(module for module in BASIC["modules"] if module["name"] == name)
            entry = {key: copy.deepcopy(value) for key, value in entry.items() if key not in new}
            entry["name"] = "Spare"
            for mark in entry["landmarks"]:
                mark.pop("heats", None)
            catalogue = load_catalogue(module_file(tmp_path, entry))
            spare, basic = catalogue["Spare"], catalogue[name]
            assert (spare.motor, spare.thrust) == (basic.motor, basic.thrust)
            assert (spare.physics, spare.flames) == (basic.physics, basic.flames)
            assert not spare.grabs


def test_a_users_module_says_what_it_does_itself(tmp_path):
    wheel = copy.deepcopy(BASIC["modules"][2])
    wheel |= {"name": "Slow Wheel", "motor": {**wheel["motor"], "speed_rpm": 30}}
    wheel["motor"]["forward_sense"] = "counterclockwise"
    catalogue = load_catalogue(module_file(tmp_path, wheel))
    assert catalogue["Slow Wheel"].motor.speed_rpm == 30
    machine = built(catalogue=catalogue)
    assert "forward rolls it <South>" in attach(machine, "1", "A", "Slow Wheel").text
    assert "forward rolls it <North>" in machine.act("flip_spin", {"block_id": "2"}).text


def test_a_users_file_adds_modules_that_can_be_built_with(tmp_path):
    catalogue = load_catalogue(module_file(tmp_path, CRATE))
    assert catalogue.attachable[-1] == "Crate"
    machine = built(("1", "C", "Crate"), catalogue=catalogue)
    assert tuple(machine.blocks["2"].center_xyz) == pytest.approx((0, 0, 2.5))
    assert Machine.from_document(machine.to_document(), catalogue=catalogue) == machine


def test_a_block_inside_another_overlaps_it(tmp_path):
    catalogue = load_catalogue(module_file(tmp_path, CRATE))
    outer, inner = built(("1", "C", "Crate"), catalogue=catalogue), built(catalogue=catalogue)
    assembly = Machine(catalogue=catalogue, available={"outer": outer, "inner": inner})
    assembly.act("add_machine", {"machine_id": "outer"})
    inside = {"machine_id": "inner", "init_shift": [0, 0, 2.5]}
    assert assembly.act("add_machine", inside).reason == RefusalClass.OVERLAP


def edit(**fields):
    return {**copy.deepcopy(CRATE), **fields}


FACE = CRATE["faces"][0]
_, WOOD, WHEEL, CANNON, TORCH, BRACE, _, CARGO = BASIC["modules"]
SPRING = FURTHER["Spring"]


def other(module, **fields):
    return {**copy.deepcopy(module), "name": "Other", **fields}


BROKEN = [
    (edit(kind="engine"), r"modules\[0\] \(Crate\).kind: expected one of block, cannon"),
    (edit(mass=0), "mass: expected a number above 0"),
    (edit(cost=1.5), "cost: expected a whole number"),
    (edit(size=[1, 2]), "size: expected a list of length 3"),
    (edit(colour="red"), "unknown field 'colour'; valid fields: push, wing"),
    (edit(colliders=[{"shape": "ball", "from": [0, 0, 0], "to": [1, 1, 1]}]), "box, cylinder"),
    (edit(colliders=[{"shape": "cylinder", "from": [0, 0, 0], "to": [1, 1, 1]}]), "radius"),
    (edit(landmarks=[{"name": "tip"}]), "along is missing"),
    (edit(besiege={"id": -1, "data": []}), "besiege.id: expected a whole number of at least 0"),
    (edit(besiege={"id": 1, "data": [{"type": "x", "key": "y", "value": []}]}), "value: expected"),
    ({key: value for key, value in CRATE.items() if key != "mass"}, "mass is missing"),
    (edit(physics={"joint_type": "axle"}), "physics: mass_at is missing"),
    (edit(physics={**WOOD["physics"], "joint_type": "glue"}), "expected one of attachment, axle"),
    (edit(physics={**WOOD["physics"], "friction": -1}), "friction: expected a number of at least"),
    (edit(landmarks=[{"name": "fire", "along": 1, "heats": True}]), "radius: expected the radius"),
    (other(BRACE, link="glue"), "link: expected one of hose, rigid, rope, spring"),
    (other(WHEEL, motor={**WHEEL["motor"], "torque": 0}), "torque: expected a number above 0"),
    (other(CANNON, thrust={**CANNON["thrust"], "spheres": [{"along": 1}]}), "radius is missing"),
]
SENSELESS = [
    (edit(faces=[{**FACE, "normal": [0, 0, 2]}]), "a direction, three numbers with length 1"),
    (edit(faces=[{**FACE, "x_axis": [0, 0, 1]}]), "perpendicular to the normal"),
    (edit(faces=[FACE, FACE]), "two faces share a label"),
    (edit(colliders=[{"shape": "box", "from": [0, 0, 0], "to": [1, 0, 1]}]), "each larger than"),
    (edit(landmarks=[{"name": "tip", "along": 1}]), "they lie along `pointing`"),
    (edit(kind="connector"), "a connector has neither faces nor colliders"),
    (edit(colliders=[]), "a block needs a size and colliders"),
    (edit(name="Torch"), "a module of this name exists already"),
    (edit(kind="start", name="Core"), "a catalogue has one starting block"),
    (other(WHEEL, actions=["spin"]), "forward: expected one of spin, found 'spinning_forward'"),
    (other(CANNON, actions=[]), "action: expected one of "),
    (other(CANNON, pointing=None, landmarks=[]), "thrust: expected no thrust: it acts along"),
    (other(BRACE, physics=WOOD["physics"]), "physics: expected no physics: a connector is not"),
    (other(CARGO, thrust=CANNON["thrust"]), "action: expected one of "),
    (edit(strut={"bending_stiffness": 1}), "strut: expected no strut: a spring and a strut are"),
    (other(BRACE, link="rope", strut={"bending_stiffness": 1}), "no strut: its link is rope"),
    (edit(link="rope"), "link: expected no link: a block is not a connector"),
    (edit(physics=WHEEL["physics"]), "the joint type axle needs either a motor or a joint"),
    (other(SPRING, link="rigid"), "spring: expected a spring with the link"),
    (other(SPRING, link="rope"), "spring: expected a spring with the link"),
    (other(BRACE, link="spring"), "spring: expected a spring with the link"),
    (other(SPRING, lift={"force": 1}), "lift: expected no lift"),
]


def test_a_bad_module_is_refused_with_its_place_and_what_belongs_there(tmp_path, subtests):
    for module, message in [*BROKEN, *SENSELESS]:
        with subtests.test(module=module), pytest.raises(CatalogueError, match=message):
            load_catalogue(module_file(tmp_path, module))


def test_the_schema_refuses_what_the_library_refuses():
    schema = jsonschema.Draft202012Validator(SCHEMA)
    contents = [{"version": 1, "modules": [module]} for module, _ in BROKEN]
    assert [content for content in contents if schema.is_valid(content)] == []


def test_files_that_are_none_are_refused_by_name(tmp_path):
    with pytest.raises(CatalogueError, match=r"nowhere\.json: can't be read"):
        load_catalogue(tmp_path / "nowhere.json")
    (tmp_path / "bad.yaml").write_text("a: [")
    with pytest.raises(CatalogueError, match=r"bad\.yaml: is not YAML"):
        load_catalogue(tmp_path / "bad.yaml")
    (tmp_path / "old.json").write_text('{"version": 0, "modules": []}')
    with pytest.raises(CatalogueError, match="version: expected version 1, found 0"):
        load_catalogue(tmp_path / "old.json")


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


SPEED = {"kind": "speed", "rate": 600, "force": 20}
SENSELESS_JOINTS = [
    ("attachment", {"joint": {}}, "joint: expected no joint: only one of the joint types axle"),
    ("mount", {"joint": {}}, "moves, found 'mount'"),
    ("hinge", {"gear": {"pitch_radius": 1}}, "no gear: a cog's joint type is axle, not hinge"),
    ("axle", {}, "the joint type axle needs either a motor or a joint"),
    ("hinge", {"joint": {"axis": [1, 1, 0]}}, "axis: expected a direction"),
    ("hinge", {"joint": {"limits": [10, 40]}}, "limits: expected two numbers, the first at most 0"),
    ("hinge", {"joint": {"limits": [0, 0]}}, "limits: expected two numbers"),
    ("hinge", {"joint": {"limits": [-180, 90]}}, "two angles between -180 and 180 degrees"),
    ("ball", {"joint": {"limits": [-10, 10]}}, "no limits: one of the joint types hinge, slider"),
    ("constant_velocity", {"joint": {"limits": [-10, 20]}}, "two opposite angles up to 150"),
    ("constant_velocity", {"joint": {"limits": [-160, 160]}}, "two opposite angles up to 150"),
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
    (
        "slider",
        {"joint": {"drive": {**SERVO, "forward_sense": "clockwise"}}},
        "no sense: a slider does not turn",
    ),
]


def test_senseless_joints_are_refused_with_what_belongs_there(tmp_path, subtests):
    for seat, fields, message in SENSELESS_JOINTS:
        with subtests.test(seat=seat), pytest.raises(CatalogueError, match=message):
            _loaded(tmp_path, seat, **fields)


def with_force(name, field, **changes):
    entry = copy.deepcopy(FURTHER[name])
    entry["name"] = "Other"
    entry[field] = {**entry[field], **changes}
    return entry


def read(tmp_path, entry):
    return load_catalogue(module_file(tmp_path, entry))["Other"]


def test_a_wings_flow_is_its_normal_turned_by_the_pitch(tmp_path):
    flat = read(tmp_path, with_force("Propeller", "wing", pitch_deg=0)).wing
    assert flat.flow == flat.normal == (0.0, 1.0, 0.0)
    quarter = read(tmp_path, with_force("Propeller", "wing", pitch_deg=90)).wing
    assert quarter.flow == pytest.approx((1.0, 0.0, 0.0))
    x_first = read(tmp_path, with_force("Propeller", "wing", normal=[1, 0, 0], pitch_deg=90)).wing
    assert x_first.flow == pytest.approx((0.0, -1.0, 0.0))


def test_a_force_that_makes_no_sense_is_refused_by_its_name(tmp_path, subtests):
    for name, field, changes, said in [
        ("Flying Block", "push", {"action": "rise"}, r"push\.action: expected one of fly"),
        ("Flying Block", "push", {"direction": [0, 0, 2]}, r"push\.direction: expected a direct"),
        ("Flying Block", "push", {"force": -1}, r"push\.force: expected a number of at least 0"),
        ("Propeller", "wing", {"power": 3}, r"wing\.power: expected one of 0, 1, 2"),
        ("Propeller", "wing", {"coefficient": 0.04}, r"wing\.coefficient: .* at most 0\.0333"),
        ("Propeller", "wing", {"twist": 3}, r"unknown field 'twist'"),
        ("Sqr Balloon", "altitude", {"damping": 2}, r"altitude\.damping: .* at most 1\.5"),
        ("Sqr Balloon", "altitude", {"sink": "fly"}, r"altitude\.sink: expected one of rise, sink"),
        ("Balloon", "rope_mount", {"length": 0}, r"rope_mount\.length: expected a number above 0"),
        ("Spring", "spring", {"stiffness": 1e6}, r"spring\.stiffness: .* at most 1000"),
        ("Spring", "spring", {"shortest": 1.5}, r"spring\.shortest: .* at most 1"),
        ("Spring", "spring", {"contract": "pull"}, r"spring\.contract: expected one of contract"),
        ("Decoupler", "decouple", {"impulse": -5}, r"decouple\.impulse: expected .* at least 0"),
        ("Grabber", "grip", {"reach": 0}, r"grip\.reach: expected a number above 0"),
    ]:
        with subtests.test(name=name), pytest.raises(CatalogueError, match=said):
            read(tmp_path, with_force(name, field, **changes))


def test_the_forces_of_the_further_types_fit_the_schema_and_say_where_they_are_from():
    jsonschema.validate({"version": 1, "modules": list(FURTHER.values())}, SCHEMA)
    told = [(name, key) for name, one in FURTHER.items() for key in FORCE_FIELDS if key in one]
    assert told
    for name, field in told:
        origin = FURTHER[name][field]["origin"]
        assert any(word in origin for word in ("known", "community", "chosen"))


def test_a_springs_key_is_bound_like_a_blocks():
    sides = [("1", face, BLOCK) for face in "EF"]
    machine = built(*sides, catalogue=module_set("workshop"))
    assert connect(machine, "2", "A", "3", "A", connector="Spring").ok
    bound = {"block_id": "4", "action": "contract", "new_key": "UpArrow"}
    assert machine.act("change_control_key", bound).ok
    assert machine.act("add_control_key", {**bound, "new_key": "Alpha1"}).ok
    assert machine.connectors["4"].bindings == {"contract": ("UpArrow", "Alpha1")}
    assert "4 Spring: contract UpArrow, Alpha1" in machine.act("review_control_config").text
    assert "Spring" in machine.act("review_powered_blocks").text
    press = {"time": 0, "key": "Alpha1", "hold_for": 1}
    assert machine.act("add_control_sequence", press).ok
    assert not machine.act("add_control_sequence", {**press, "key": "Alpha2"}).ok
    copy_of = Machine.from_document(machine.to_document(), catalogue=module_set("workshop"))
    assert copy_of.to_document() == machine.to_document()
