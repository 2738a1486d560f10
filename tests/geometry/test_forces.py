"""What module files say of fans, wings, balloons, springs and what lets go."""

import copy

import jsonschema
import pytest
from support.machines.building import BLOCK, built, connect
from support.machines.module_files import SCHEMA, entries, module_file

from buildarena_geometry import CatalogueError, Machine, load_catalogue
from buildarena_geometry.modules.forces import FORCE_FIELDS
from buildarena_geometry.modules.sets import module_set

FURTHER = entries("extended.yaml")


def other(name, field, **changes):
    entry = copy.deepcopy(FURTHER[name])
    entry["name"] = "Other"
    entry[field] = {**entry[field], **changes}
    return entry


def read(tmp_path, entry):
    return load_catalogue(module_file(tmp_path, entry))["Other"]


def test_a_wings_flow_is_its_normal_turned_by_the_pitch(tmp_path):
    flat = read(tmp_path, other("Propeller", "wing", pitch_deg=0)).wing
    assert flat.flow == flat.normal == (0.0, 1.0, 0.0)
    quarter = read(tmp_path, other("Propeller", "wing", pitch_deg=90)).wing
    assert quarter.flow == pytest.approx((1.0, 0.0, 0.0))
    x_first = read(tmp_path, other("Propeller", "wing", normal=[1, 0, 0], pitch_deg=90)).wing
    assert x_first.flow == pytest.approx((0.0, -1.0, 0.0))


@pytest.mark.parametrize(
    ("name", "field", "changes", "said"),
    [
        ("Flying Block", "push", {"action": "rise"}, r"push\.action: expected one of fly"),
        ("Flying Block", "push", {"direction": [0, 0, 2]}, r"push\.direction: expected a direct"),
        ("Flying Block", "push", {"force": -1}, r"push\.force: expected a number of at least 0"),
        ("Propeller", "wing", {"power": 3}, r"wing\.power: expected one of 0, 1, 2"),
        ("Propeller", "wing", {"coefficient": 0.04}, r"wing\.coefficient: .* at most 0\.0333"),
        ("Propeller", "wing", {"twist": 3}, r"there is no field 'twist'"),
        ("Sqr Balloon", "altitude", {"damping": 2}, r"altitude\.damping: .* at most 1\.5"),
        ("Sqr Balloon", "altitude", {"sink": "fly"}, r"altitude\.sink: expected one of rise, sink"),
        ("Balloon", "rope_mount", {"length": 0}, r"rope_mount\.length: expected a number above 0"),
        ("Spring", "spring", {"stiffness": 1e6}, r"spring\.stiffness: .* at most 1000"),
        ("Spring", "spring", {"shortest": 1.5}, r"spring\.shortest: .* at most 1"),
        ("Spring", "spring", {"contract": "pull"}, r"spring\.contract: expected one of contract"),
        ("Decoupler", "decouple", {"impulse": -5}, r"decouple\.impulse: expected .* at least 0"),
        ("Grabber", "grip", {"reach": 0}, r"grip\.reach: expected a number above 0"),
    ],
)
def test_a_force_that_makes_no_sense_is_refused_by_its_name(tmp_path, name, field, changes, said):
    with pytest.raises(CatalogueError, match=said):
        read(tmp_path, other(name, field, **changes))


def test_only_connectors_with_the_link_spring_have_one(tmp_path):
    for link in ("rigid", "rope"):
        with pytest.raises(CatalogueError, match=r"spring: expected a spring with the link"):
            read(tmp_path, {**other("Spring", "spring"), "link": link})
    without = {key: value for key, value in other("Spring", "spring").items() if key != "spring"}
    with pytest.raises(CatalogueError, match=r"spring: expected a spring with the link"):
        read(tmp_path, without)
    fan = {**other("Spring", "spring"), "lift": {"force": 1}}
    with pytest.raises(CatalogueError, match=r"lift: expected no lift"):
        read(tmp_path, fan)


def test_the_forces_of_the_further_types_fit_the_schema_and_say_where_they_are_from():
    jsonschema.validate({"version": 1, "modules": list(FURTHER.values())}, SCHEMA)
    told = [
        (name, field) for name, one in FURTHER.items() for field in FORCE_FIELDS if field in one
    ]
    assert len(told) == 22
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


def test_documents_of_braces_and_winches_tell_no_keys():
    machine = built(*(("1", face, BLOCK) for face in "EF"))
    assert connect(machine, "2", "A", "3", "A").ok
    assert "bindings" not in machine.to_document()["connectors"][0]
