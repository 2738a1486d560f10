"""The module catalogue, and files that extend it."""

from __future__ import annotations

import copy
import json
from importlib import resources

import jsonschema
import pytest
import yaml

from buildarena_geometry import CatalogueError, Machine, RefusalClass, load_catalogue

FILES = resources.files("buildarena_geometry.modules")
BASIC = json.loads(FILES.joinpath("modules.yaml").read_text())
SCHEMA = json.loads(FILES.joinpath("modules.schema.json").read_text())
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


def write(tmp_path, *modules, name="more.json"):
    file = tmp_path / name
    file.write_text(json.dumps({"version": 1, "modules": list(modules)}))
    return file


@pytest.mark.parametrize(
    ("name", "facts"),
    [
        ("Starting Block", ("start", 0, 0.25, 1, "ABCDEF")),
        ("Small Wooden Block", ("block", 15, 0.3, 1, "ABCDEF")),
        ("Powered Wheel", ("wheel", 2, 1.0, 1, "E")),
        ("Water Cannon", ("cannon", 56, 1.5, 1, "")),
        ("Torch", ("torch", 47, 1.0, 13, "")),
        ("Brace", ("connector", 7, 0.5, 2, "")),
        ("Winch", ("connector", 45, 0.4, 1, "")),
        ("Ballast", ("cargo", 35, 5.0, 0, "")),
    ],
)
def test_the_basic_modules_are_those_of_the_paper(name, facts):
    module = load_catalogue()[name]
    labels = "".join(face.label for face in module.faces)
    assert (module.kind, module.besiege_id, module.mass, module.cost, labels) == facts
    assert module.description


def test_the_file_is_yaml_and_json_alike_and_fits_its_schema():
    assert yaml.safe_load(FILES.joinpath("modules.yaml").read_text()) == BASIC
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    jsonschema.validate(BASIC, SCHEMA)


def test_a_users_file_adds_modules_that_can_be_built_with(tmp_path):
    catalogue = load_catalogue(write(tmp_path, CRATE))
    assert catalogue.attachable[-1] == "Crate"
    machine = Machine(catalogue=catalogue)
    machine.act("start")
    crate = {"base_block": "1", "face": "C", "new_block": "Crate"}
    assert machine.act("attach_block_to", crate).ok
    assert tuple(machine.blocks["2"].center) == pytest.approx((0, 0, 2.5))
    assert Machine.from_document(machine.to_document(), catalogue=catalogue) == machine


def test_a_block_inside_another_overlaps_it(tmp_path):
    catalogue = load_catalogue(write(tmp_path, CRATE))
    outer, inner = Machine(catalogue=catalogue), Machine(catalogue=catalogue)
    outer.act("start")
    outer.act("attach_block_to", {"base_block": "1", "face": "C", "new_block": "Crate"})
    inner.act("start")
    assembly = Machine(catalogue=catalogue, available={"outer": outer, "inner": inner})
    assembly.act("add_machine", {"machine_id": "outer"})
    inside = {"machine_id": "inner", "init_shift": [0, 0, 2.5]}
    assert assembly.act("add_machine", inside).reason == RefusalClass.OVERLAP


def test_a_users_file_may_be_yaml(tmp_path):
    file = tmp_path / "more.yaml"
    file.write_text(yaml.safe_dump({"version": 1, "modules": [CRATE]}))
    assert load_catalogue(file)["Crate"].mass == 4


def edit(**fields):
    return {**copy.deepcopy(CRATE), **fields}


FACE = CRATE["faces"][0]
BROKEN = [
    (edit(name=3), "name: expected a text"),
    (edit(kind="engine"), r"modules\[0\] \(Crate\).kind: expected one of start, block"),
    (edit(mass=0), "mass: expected a number above 0"),
    (edit(mass="heavy"), "mass: expected a number"),
    (edit(cost=1.5), "cost: expected a whole number"),
    (edit(size=[1, 2]), "size: expected 3 numbers"),
    (edit(colour="red"), "there is no field 'colour'; the fields are name, kind"),
    (edit(faces=[{**FACE, "normal": "up"}]), r"faces\[0\].normal: expected 3 numbers"),
    (edit(colliders=[{"shape": "ball", "from": [0, 0, 0], "to": [1, 1, 1]}]), "box, cylinder"),
    (edit(colliders=[{"shape": "cylinder", "from": [0, 0, 0], "to": [1, 1, 1]}]), "radius"),
    (edit(landmarks=[{"name": "tip"}]), "along is missing"),
    (edit(besiege={"id": -1, "data": []}), "besiege.id: expected a whole number of at least 0"),
    (edit(besiege={"id": 1, "data": [{"type": "x", "key": "y", "value": []}]}), "value: expected"),
    ({key: value for key, value in CRATE.items() if key != "mass"}, "mass is missing"),
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
]


@pytest.mark.parametrize(("module", "message"), [*BROKEN, *SENSELESS])
def test_a_bad_module_is_refused_with_its_place_and_what_belongs_there(tmp_path, module, message):
    with pytest.raises(CatalogueError, match=message):
        load_catalogue(write(tmp_path, module))


@pytest.mark.parametrize("module", [module for module, _ in BROKEN])
def test_the_schema_refuses_what_the_library_refuses(module):
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({"version": 1, "modules": [module]}, SCHEMA)


def test_files_that_are_none_are_refused_by_name(tmp_path):
    with pytest.raises(CatalogueError, match=r"nowhere\.json: can't be read"):
        load_catalogue(tmp_path / "nowhere.json")
    (tmp_path / "bad.yaml").write_text("a: [")
    with pytest.raises(CatalogueError, match=r"bad\.yaml: is not YAML"):
        load_catalogue(tmp_path / "bad.yaml")
    (tmp_path / "old.json").write_text('{"version": 0, "modules": []}')
    with pytest.raises(CatalogueError, match="version: expected version 1, found 0"):
        load_catalogue(tmp_path / "old.json")
