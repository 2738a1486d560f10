"""The sets of modules, the rules that further types bring, and their data sheets."""

import itertools
import json
import math
import re

import fcl
import numpy as np
import pytest
from support.machines.building import BLOCK, attach, built
from support.machines.module_files import BASIC, like, module_file

from buildarena_geometry import (
    MODULE_SETS,
    CatalogueError,
    Machine,
    catalogue_of,
    load_catalogue,
    module_set,
    modules_named,
    replay,
    simulated_modules,
)
from buildarena_geometry.feedback.data_sheets import data_sheet
from buildarena_geometry.modules.catalogue import read_modules
from buildarena_geometry.modules.solids import Ball

EXTENDED = [name for name in module_set("all") if name not in load_catalogue()]


def own(tmp_path, **fields):
    """The basic modules and one of our own, "Own", like the small block but for some fields."""
    return load_catalogue(module_file(tmp_path, like(BLOCK, "Own", **fields)))


def test_sets_hold_each_other():
    basic, workshop, everything = (set(module_set(name)) for name in MODULE_SETS)
    assert basic - {"Ballast"} < workshop < everything
    assert len(basic) == 8  # the paper's


def test_a_builder_gets_no_cargo_and_only_what_is_simulated():
    assert [m.kind for m in module_set("basic").values()].count("cargo") == 1
    for name in ("workshop", "all"):
        assert all(module.kind != "cargo" for module in module_set(name).values())
    assert all(module.simulated for module in module_set("workshop").values())
    left_out = set(module_set("all")) - set(module_set("workshop"))
    named = {name for name in left_out if module_set("all")[name].simulated}
    assert named == {name for name, module in module_set("all").items() if module.by_name}
    assert {"Boulder", "Bomb Holder", "Strut"} <= named <= set(simulated_modules())


def test_a_choice_is_a_set_or_names():
    assert modules_named(None) == modules_named("basic")
    assert "Starting Block" not in modules_named("all")
    assert modules_named(["Torch"]) == ("Torch",)
    assert list(catalogue_of(("Hinge", "Torch"))) == ["Starting Block", "Torch", "Hinge"]
    assert catalogue_of(("Torch",)) is catalogue_of(None) is module_set("basic")
    with pytest.raises(ValueError, match=r"module set 'big'; valid sets: basic, workshop, all"):
        modules_named("big")
    with pytest.raises(ValueError, match=r"unknown module 'Hinj'"):
        catalogue_of(("Hinj",))


def test_what_a_further_type_says_fits_together(subtests):
    for name in EXTENDED:
        with subtests.test(name=name):
            module = module_set("all")[name]
            assert module.categories
            assert module.description
            assert {"mass", "cost"} <= dict(module.sources).keys()
            if module.kind == "connector":
                return
            assert module.physics is not None
            assert module.physics.origin
            labels = [face.label for face in module.faces]
            assert labels == [label(index) for index in range(len(labels))]
            for one, other in itertools.combinations(module.faces, 2):
                apart = math.dist(one.center, other.center)
                far = apart > 0.3 or math.dist(one.normal, other.normal) > 0.5
                assert far, (one.label, other.label)
            size = np.array(extent(module.body))
            np.testing.assert_allclose(module.size, size[1] - size[0], atol=1e-6)
            drawn_in = np.array(extent(module.colliders))
            assert (drawn_in[0] >= size[0] - 1e-9).all()
            assert (drawn_in[1] <= size[1] + 1e-9).all()


def label(index):
    letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"
    return letters[index] if index < 26 else letters[index // 26 - 1] + letters[index % 26]


def extent(solids):
    corners = []
    for solid in solids:
        if isinstance(solid, Ball):
            corners += [np.array(solid.center) + s * solid.radius for s in (-1, 1)]
        elif hasattr(solid, "lowest"):
            corners += [np.array(solid.lowest), np.array(solid.highest)]
        else:
            axis = (np.array(solid.top) - solid.base) / solid.length
            across = solid.radius * np.sqrt(np.clip(1 - axis**2, 0, None))
            corners += [np.array(p) + s * across for p in (solid.base, solid.top) for s in (-1, 1)]
    return np.min(corners, axis=0), np.max(corners, axis=0)


def test_every_type_can_be_attached_and_comes_back_from_its_document(subtests):
    for name in module_set("all").attachable:
        with subtests.test(name=name):
            machine = built(("1", "C", name), catalogue=module_set("all"))
            document = json.loads(json.dumps(machine.to_document()))
            again = Machine.from_document(document)
            assert again == machine
            assert again.mass == pytest.approx(0.25 + module_set("all")[name].mass)


def test_documents_know_all_types_and_a_machine_only_its_own():
    machine = built(("1", "A", "Hinge"), ("2", "E", "Wing Panel"), catalogue=module_set("workshop"))
    assert Machine.from_document(machine.to_document()) == machine
    outcome = attach(built(), "1", "A", "Hinge")
    assert outcome.reason.value == "module_restriction"
    assert "Hinge" not in outcome.text.partition("Modules:")[2]


def test_a_machine_goes_on_with_what_it_was_made_of():
    machine = built(("1", "A", "Hinge"), catalogue=module_set("workshop"))
    assert machine.act("remove_block", {"block_id": "2"}).ok
    again = Machine.from_document(machine.to_document())
    assert again.catalogue is module_set("workshop")
    assert replay(again.log) == machine
    plain = built(("1", "A", "Torch"))
    attach(plain, "1", "B", "Hinge")
    assert Machine.from_document(plain.to_document()).catalogue is module_set("basic")
    everything = module_set("all")
    gate = Machine(catalogue=everything, available={"arm": built(catalogue=everything)})
    assert gate.act("add_machine", {"machine_id": "arm"}).ok
    boosted = built(("1", "A", "Booster"), catalogue=everything)
    gate = Machine(catalogue=everything, available={"arm": boosted})
    assert Machine.from_document(gate.to_document()).catalogue is everything


def test_a_wrong_name_is_answered_with_the_nearest_ones(subtests):
    for written, meant in [
        ("Hinj", "Hinge"),
        ("steering", "Steering Hinge"),
        ("wheel", "Large Wheel"),
        ("Wooden Block", "Small Wooden Block"),
        ("Baloon", "Balloon"),
        ("Propellor", "Propeller"),
        ("Powerd Wheel", "Powered Wheel"),
    ]:
        with subtests.test(written=written):
            outcome = attach(built(catalogue=module_set("all")), "1", "A", written)
            assert outcome.reason.value == "module_restriction"
            assert f'"{written}"' in outcome.text or repr(written) in outcome.text
            named = re.split(r", | and ", outcome.text.partition("Modules: ")[2])
            assert meant in named
            assert len(named) == 6
            assert named[-1] == f"{len(module_set('all').attachable) - 5} more."


def test_a_root_offset_lifts_a_block_off_its_face(tmp_path):
    down = {"label": "F", "center": [0, 0, -0.25], "normal": [0, 0, -1], "x_axis": [1, 0, 0]}
    up = {"label": "E", "center": [0, 0, 1], "normal": [0, 0, 1], "x_axis": [1, 0, 0]}
    catalogue = own(tmp_path, root_offset=0.25, faces=[up, down])
    machine = built(("1", "C", "Own"), ("2", "E", "Own"), catalogue=catalogue)
    np.testing.assert_allclose(machine.blocks["2"].world_from_block.xyz, (0, 0, 0.75))
    np.testing.assert_allclose(machine.blocks["3"].world_from_block.xyz, (0, 0, 2.0))
    assert [joint.offset for joint in machine.joints] == pytest.approx([0, 0], abs=1e-12)
    assert machine.state.free_faces(machine.blocks["3"]) == ["E"]
    machine.act("twist_block", {"block_id": "3", "angle": 45})
    assert machine.joints[1].offset == pytest.approx(0, abs=1e-12)
    machine.act("shift_block", {"block_id": "3", "shift_real": [0.1, 0, 0]})
    assert machine.joints[1].offset == pytest.approx(0.1)


def test_sitting_takes_the_face_at_the_root_or_else_the_lowest_that_looks_down(tmp_path, subtests):
    for faces, taken in [
        ([((0, 0, 0), (0, 0, -1)), ((0.5, 0, 0), (0, 0, -1))], "A"),
        ([((0.5, 0, 0.5), (0, 0, -1)), ((0, 0, 0.2), (0, 0, -1))], "B"),
        ([((0, 0, 0), (1, 0, 0)), ((0, 0, 1), (0, 0, 1))], None),
        ([((0, 0, 0.3), (0, 0.6, -0.8)), ((0, 0, 1), (0, 0, 1))], None),
        ([((0, 0, 0.3), (0, math.sin(0.3), -math.cos(0.3))), ((0, 0, 1), (0, 0, 1))], "A"),
    ]:
        with subtests.test(faces=faces):
            entries = [
                {"label": name, "center": center, "normal": normal, "x_axis": across(normal)}
                for name, (center, normal) in zip("AB", faces, strict=True)
            ]
            module = own(tmp_path, faces=entries)["Own"]
            assert module.root_face == taken


def across(normal):
    return [1, 0, 0] if abs(normal[0]) < 0.5 else [0, 1, 0]


def test_what_reaches_into_its_base_may_not_reach_through_it(tmp_path):
    rod = {"shape": "cylinder", "radius": 0.2, "from": [0, 0, -1.4], "to": [0, 0, 0]}
    catalogue = own(tmp_path, overlaps_base=True, colliders=[*BASIC[BLOCK]["colliders"], rod])
    machine = built(("1", "A", BLOCK), catalogue=catalogue)
    assert attach(machine, "2", "E", "Own").overlaps == (("3", "1"),)


def test_what_reaches_into_its_base_still_meets_it_after_that_base_was_exchanged(tmp_path):
    rod = {"shape": "cylinder", "radius": 0.2, "from": [0, 0, -0.4], "to": [0, 0, 0]}
    catalogue = own(tmp_path, overlaps_base=True, colliders=[*BASIC[BLOCK]["colliders"], rod])
    machine = built(("1", "A", "Small Wooden Block"), ("2", "E", "Own"), catalogue=catalogue)
    assert machine.act("remove_block", {"block_id": "2"}).ok
    outcome = attach(machine, "1", "A")
    assert not outcome.ok, "a rod that sits nowhere is a shape like any other"
    assert outcome.overlaps == (("4", "3"),)


def test_balls_meet_as_balls(tmp_path):
    ball = [{"shape": "sphere", "radius": 0.8, "center": [0, 0, 1]}]
    catalogue = own(tmp_path, body=ball, colliders=ball, faces=[], size=[1.6, 1.6, 1.6])
    machine = built(("1", "C", "Own"), ("1", "A", "Small Wooden Block"), catalogue=catalogue)
    assert attach(machine, "3", "D", "Own").ok
    middles = [np.array(b.world_from_block.point((0, 0, 1))) for b in machine.blocks.values()]
    assert np.linalg.norm(middles[1] - middles[3]) > 1.6
    near = {"block_id": "2", "shift_real": [0.5, 0, 0]}
    for _ in range(3):
        outcome = machine.act("shift_block", near)
    world = [fcl.CollisionObject(fcl.Sphere(0.8), fcl.Transform(middles[i])) for i in (1, 3)]
    assert fcl.distance(*world) > 0
    assert outcome.ok or outcome.overlaps


def test_bad_fields_are_named(subtests):
    for fields, complaint in [
        ({"default_keys": {1: "H"}}, r"default_keys: expected an object whose keys are texts"),
        ({"kind": "\ud800"}, r"expected texts without lone surrogates"),
        ({"root_offset": -1}, r"root_offset: expected a number of at least 0"),
        ({"default_keys": {"fly": "H"}}, r"default_keys.fly: expected keys of the actions none"),
        ({"sources": {"mass": "a book"}}, r"sources.mass: .* known, community, chosen, unknown"),
        ({"body": [{"shape": "sphere", "radius": 0, "center": [0, 0, 0]}]}, r"above 0"),
    ]:
        with subtests.test(fields=fields):
            content = {"version": 1, "modules": [like(BLOCK, "Own", **fields)]}
            with pytest.raises(CatalogueError, match=complaint):
                read_modules(content, where="file")


WORKSHOP = module_set("workshop")


SHEETS = {
    "Powered Wheel": ("motor 10.47 rad/s after 0.19 s", "torque and brake up to 20"),
    "Suspension": ("slides along z -1 to 0", "spring 20/unit", "damper 1.2 s/unit"),
    "Steering Hinge": ("about x through (0,0,0.5) -40° to 40°", "torque up to 40"),
    "Cog Large Unpowered": ("pitch radius 2;", "friction 0.6", "drag 0"),
    "Water Cannon": ("1.6 cold, 13.76 heated",),
    "Flying Block": ("pushes 3.25 along z",),
    "Wing Panel": ("-0.02·(v·n)·min(|v|, 30)^2", "n = (0,1,0)"),
    "Sqr Balloon": ("lift 2.7 per unit", "- 0.9 per unit/s", "to 5.4", "at 2 units/s"),
    "Balloon": ("rope of 2.5", "lift 0.92"),
    "Spring": ("pulls 10 per unit", "damper 0.1", "to 0.4 of", "at 2 built", "breaks at 1000"),
    "Strut": ("mass 0.5 per unit of length", "buckles at 9603 / length²"),
    "Decoupler": ("impulse 5",),
    "Grabber": ("within 0.2", "force 200 or moment 100"),
}


def test_a_sheet_has_the_figures_of_its_module_in_one_line(subtests):
    for name in (*WORKSHOP, "Strut"):
        with subtests.test(name=name):
            text = data_sheet(module_set("all")[name], WORKSHOP.start.physics)
            assert "\n" not in text
            assert [told for told in SHEETS.get(name, ()) if told not in text] == []


def test_who_looks_a_module_up_reads_its_data_where_they_are_told():
    for catalogue in (WORKSHOP, WORKSHOP.with_data_sheets):
        machine = Machine(catalogue=catalogue)
        answer = machine.act("describe_module", {"module": "Steering Hinge"}).text
        assert ("torque up to 40" in answer) == catalogue.data_sheets
