"""Machine files and levels hold what the published library saves; every module type comes back."""

import math
from xml.etree import ElementTree as ET

import pytest
from support.machines.building import attach
from tests.besiege.golden import (
    LEVELS,
    content,
    dangles,
    goldens,
    played_document,
    scenario_of,
)
from tests.besiege.normal import normal_form
from tests.besiege.test_reading_files import assert_alike, contents

from buildarena_benchmark import builtin_tasks
from buildarena_besiege import (
    MachineNotPlayableError,
    level_file,
    plain_machine_file,
    prepare_run,
    read_machine_file,
)
from buildarena_geometry import Machine, module_set
from buildarena_geometry.modules.module import Module
from buildarena_geometry.rotations import multiply
from buildarena_simulation import Scenario
from buildarena_simulation.scenario import TerrainBox

TOLERANCE = 1e-6
ENDS = ("start-rotation", "end-rotation")


def test_exports_are_the_published_ones(subtests) -> None:
    for found in goldens():
        for theirs in found.exports:
            with subtests.test(found.name, category=theirs["category"], level=theirs["level"]):
                assert_published(found, theirs)


def assert_published(found, theirs) -> None:
    machine = Machine.from_document(played_document(found, theirs))
    ours = normal_form(machine, scenario_of(theirs))
    assert ours["refused"] == theirs["refused"]
    if theirs["refused"]:
        return
    for part in ("machine", "run"):
        assert ours[part] == theirs.get(part)
    assert ours["data"] == theirs["data"]
    left_out = {b["local_id"] for b in theirs["blocks"] if missing(found, b)}
    gaps = set(theirs["connector_gaps"])
    blocks = {block["local_id"]: block for block in ours["blocks"]}
    assert next(iter(blocks)) == theirs["blocks"][0]["local_id"]
    assert ("Ballast" in blocks) == (list(blocks)[-1] == "Ballast")
    assert blocks.keys() == {block["local_id"] for block in theirs["blocks"]} - left_out
    for block in theirs["blocks"]:
        if block["local_id"] in left_out:
            continue
        stale = block["local_id"] in gaps or (
            block["local_id"] == "Ballast" and (theirs.get("centres_stale") or left_out)
        )
        assert_same_block(blocks[block["local_id"]], block, stale=stale)
    if not left_out:
        assert_same_place(ours, theirs)
    if theirs["category"] in ("transport", "support"):
        assert set(ours["tracked"]) == set(theirs["tracked"])


def missing(found, block) -> bool:
    """Whether it is a connector on a removed block: our library removes it with the block."""
    return any(one["id"] == block["local_id"] and dangles(one) for one in found.state["blocks"])


def assert_same_block(ours, theirs, *, stale) -> None:
    where = theirs["local_id"]
    assert (ours["name"], ours["id"]) == (theirs["name"], theirs["id"]), where
    assert near(ours["scale"], theirs["scale"]), where
    if not stale:
        assert near(ours["position"], theirs["position"]), where
        assert same_turn(ours["rotation_xyzw"], theirs["rotation_xyzw"]), where
    assert [entry[:2] for entry in ours["data"]] == [entry[:2] for entry in theirs["data"]], where
    for (kind, key, value), (_, _, wanted) in zip(ours["data"], theirs["data"], strict=True):
        if key in ENDS:
            assert stale or same_turn(zyz(value), zyz(wanted)), (where, key)
        elif kind == "Vector3":
            assert stale or near(value, wanted), (where, key)
        else:
            assert value == wanted, (where, key)
            assert type(value) is type(wanted), (where, key)


def assert_same_place(ours, theirs) -> None:
    current = theirs.get("placement_current_centres", {})
    ours_at, turn = ours["global"]["position"], ours["global"]["rotation_xyzw"]
    if "turned" in current:
        if current["margin"] > TOLERANCE:
            wanted = math.sqrt(0.5) if current["turned"] else 0.0
            assert near(turn, [0.0, wanted, 0.0, wanted or 1.0])
            assert near(ours_at, current["centred"])
        return
    assert near(turn, theirs["global"]["rotation_xyzw"])
    stale = theirs.get("centres_stale")
    assert near(ours_at, current["upstream_rule"] if stale else theirs["global"]["position"])
    if stale and "Ballast" in {block["local_id"] for block in ours["blocks"]}:
        assert near(ours["blocks"][-1]["position"], current["cargo_root"])


def near(left, right) -> bool:
    return all(abs(a - b) <= TOLERANCE for a, b in zip(left, right, strict=True))


def same_turn(left, right) -> bool:
    return near(left, right) or near(left, [-value for value in right])


def zyz(angles):
    """The quaternion of a connector's end: its angles are defined in part only."""
    first, tilt, last = (math.radians(one) / 2 for one in (angles[0] - 270.0, *angles[1:]))

    def about_z(half):
        return (math.cos(half), 0.0, 0.0, math.sin(half))

    over = (math.cos(tilt), 0.0, math.sin(tilt), 0.0)
    return multiply(multiply(about_z(first), over), about_z(last))


ALL = module_set("all")
BLOCKS = list(ALL.attachable)
CONNECTORS = list(ALL.connectors)
CARGO = builtin_tasks()["support-1"].scenario


def built_with(module: Module) -> Machine:
    """A machine with one module of a type, its keys bound, and another on it where one can sit."""
    machine = Machine(catalogue=ALL)
    assert machine.act("start").ok
    if module.kind == "connector":
        assert attach(machine, "1", "E").ok
        ends = {"block_a": "1", "face_a": "A", "block_b": "2", "face_b": "A"}
        outcome = machine.act("connect_blocks", {**ends, "connector": module.name})
    else:
        outcome = attach(machine, "1", "E", module.name)
    assert outcome.ok, outcome.text
    number = next(reversed([*machine.blocks, *machine.connectors]))
    for key, action in enumerate(module.actions, 1):
        bound = {"block_id": number, "action": action, "new_key": f"Alpha{key}"}
        if number in machine.blocks:
            outcome = machine.act("change_control_key", bound)
            assert outcome.ok, outcome.text
    return machine


def test_every_type_comes_back_as_it_was(subtests) -> None:
    for name in [*BLOCKS, *CONNECTORS]:
        with subtests.test(name=name):
            # The game has no braces that weigh by their length: a Strut is one of its braces.
            machine = built_with(ALL["Brace" if name == "Strut" else name])
            imported = read_machine_file(plain_machine_file(built_with(ALL[name]), name="m"))
            assert imported.not_understood == ()
            assert_alike(contents(imported.machine), contents(machine))
            assert Machine.from_document(imported.machine.to_document()) == imported.machine


def test_a_ballast_of_the_machine_is_told_from_the_cargo() -> None:
    machine = built_with(ALL["Ballast"])
    run = prepare_run(machine, CARGO, name="m", run_id="r")
    imported = read_machine_file(run.machine_file)
    assert [("cargo" in one) for one in imported.not_understood] == [True]
    assert_alike(contents(imported.machine), contents(machine))


def test_in_files_of_others_the_ballast_that_sits_on_nothing_is_cargo() -> None:
    file = ET.fromstring(plain_machine_file(built_with(ALL["Ballast"]), name="m"))
    for script in [one for one in file.iter("StringArray") if one.get("key") == "lua_data"]:
        script.text = ""
    attached = read_machine_file(ET.tostring(file))
    names = [block.module.name for block in attached.machine.blocks.values()]
    assert names == ["Starting Block", "Ballast"]
    ballast = next(one for one in file.iter("Block") if one.get("id") == "35")
    ballast.find("Transform/Position").set("y", "9")
    loose = read_machine_file(ET.tostring(file))
    assert [block.module.name for block in loose.machine.blocks.values()] == ["Starting Block"]
    assert any("a cargo is the task's" in one for one in loose.not_understood)


def test_a_trial_that_a_machine_file_cannot_say_is_refused() -> None:
    scenario = builtin_tasks()["flight-2"].scenario
    with pytest.raises(MachineNotPlayableError, match="use another engine"):
        prepare_run(built_with(ALL["Log"]), scenario, name="m", run_id="r")


def test_a_level_with_a_quarter_pipe_is_written_and_one_that_is_turned_is_refused() -> None:
    pipe = {"shape": "pipe", "center": [0, 6, 5], "radius": 5, "length": 6, "from_deg": 0}
    for heading_deg in (0, 30):
        terrain = [{**pipe, "to_deg": 90, "heading_deg": heading_deg}]
        scenario = Scenario.model_validate({"duration_s": 2, "terrain": terrain})
        if heading_deg:
            with pytest.raises(MachineNotPlayableError, match="no turned boxes"):
                prepare_run(built_with(ALL["Log"]), scenario, name="m", run_id="r")
        else:
            run = prepare_run(built_with(ALL["Log"]), scenario, name="m", run_id="r")
            assert run.level is not None
            assert run.level.count(b"<Object ID") == 12


def test_a_trial_with_a_boulder_is_refused_and_its_plain_file_is_not() -> None:
    machine, scenario = built_with(ALL["Boulder"]), builtin_tasks()["throw-1"].scenario
    with pytest.raises(MachineNotPlayableError, match="what a boulder touches: use another"):
        prepare_run(machine, scenario, name="m", run_id="r")
    assert b'id="36"' in plain_machine_file(machine, name="m")


def read(scenario):
    data = level_file(scenario)
    assert data.startswith(b"\xef\xbb\xbf<?xml")
    return ET.fromstring(data)


def numbers(element, names="xyz"):
    return [float(element.get(name)) for name in names]


def test_support_levels_are_the_published_ones(subtests) -> None:
    for level in LEVELS:
        with subtests.test(level=level):
            theirs = content()["levels"][level]
            ours = read(builtin_tasks()[f"support-{LEVELS.index(level) + 1}"].scenario)
            assert ours.tag == theirs["root"]
            settings = ours.find("LevelSettings")
            assert dict(settings.attrib) == theirs["settings"]
            assert {flag.tag: dict(flag.attrib) for flag in settings} == theirs["flags"]
            data = ours.find("CustomData")
            assert [[one.tag, one.get("key"), []] for one in data] == theirs["custom_data"]
            objects = list(ours.find("Objects"))
            assert len({one.get("ID") for one in objects}) == len(objects)
            for one, wanted in zip(objects, theirs["objects"], strict=True):
                assert one.get("Prefab") == wanted["attrs"]["Prefab"]
                assert numbers(one.find("Position")) == pytest.approx(wanted["position"], abs=1e-6)
                assert numbers(one.find("Scale")) == pytest.approx(wanted["scale"], abs=1e-6)
                assert (one.find("Rotation") is None) == (wanted["rotation"] is None)
                entries = [[e.tag, e.get("key"), e.text == "True"] for e in one.find("Data")]
                assert entries == wanted["data"]


def test_a_slope_rises_towards_the_north() -> None:
    box = TerrainBox(center=(1.0, 2.0, 3.0), size=(4.0, 6.0, 2.0), slope_deg=30.0)
    one = read(Scenario(duration_s=1.0, terrain=(box,))).find("Objects")[0]
    x, y, z, w = numbers(one.find("Rotation"), "xyzw")
    # Left-handed, a turn by a negative angle about east lifts what lies north.
    assert (y, z) == (0.0, 0.0)
    assert math.degrees(2 * math.atan2(x, w)) == pytest.approx(-30.0)
    down = (1.0, 3.0 - math.cos(math.radians(30)), 2.0 + math.sin(math.radians(30)))
    assert numbers(one.find("Position")) == pytest.approx(down)
    assert numbers(one.find("Scale")) == [4.0, 2.0, 6.0]
