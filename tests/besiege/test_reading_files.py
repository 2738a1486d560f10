"""Machine files come back: ours as they were, others as far as they can be, and nothing else."""

import gzip
import json
import re

import numpy as np
import pytest
from support.machine_files import RICH, published_files
from tests.besiege.foreign_files import block, foreign
from tests.besiege.golden import golden, goldens, scenario_of
from tests.besiege.normal import normal_form
from tests.besiege.playing import act, press, vehicle
from tests.besiege.round_trips import round_trip

from buildarena_benchmark import builtin_tasks
from buildarena_besiege import plain_machine_file, prepare_run, read_any_machine, read_machine_file
from buildarena_geometry import DocumentError, Machine

_ENDS = [(one, one.exports[end]) for one in goldens() for end in (0, -1)]
EXPORTS = [(one, export) for one, export in _ENDS if not export["refused"]]
SCRIPT = re.compile(rb'<StringArray key="lua_data">.*?</StringArray>', re.DOTALL)


def without_script(data: bytes) -> bytes:
    return SCRIPT.sub(b'<StringArray key="lua_data" />', data)


def contents(machine: Machine) -> dict:
    document = machine.to_document()
    return {name: document[name] for name in document if name not in ("log", "available")}


def assert_alike(left, right, where="document") -> None:
    """Equal values; floats up to rounding."""
    if isinstance(left, float):
        assert left == pytest.approx(right, abs=1e-9), where
    elif isinstance(left, dict):
        assert left.keys() == right.keys(), where
        for key in left:
            assert_alike(left[key], right[key], f"{where}.{key}")
    elif isinstance(left, list):
        assert len(left) == len(right), where
        for i, (one, other) in enumerate(zip(left, right, strict=True)):
            assert_alike(one, other, f"{where}[{i}]")
    else:
        assert left == right, where


def written(machine, scenario, presses) -> bytes:
    if scenario is None:
        return plain_machine_file(machine, name="m", controls=presses)
    return prepare_run(machine, scenario, name="m", run_id="r", controls=presses).machine_file


def test_our_files_come_back_as_they_were(subtests) -> None:
    for found, export in EXPORTS:
        with subtests.test(found=found):
            machine, presses = found.played(export)
            scenario = scenario_of(export)
            imported = read_machine_file(written(machine, scenario, presses))
            wanted = contents(machine)
            wanted["control_sequence"] = [
                {"time_s": one.time_s, "key": one.key, "hold_for_s": one.hold_for_s}
                for one in presses
            ]
            assert_alike(contents(imported.machine), wanted)
            cargo = scenario is not None and scenario.cargo is not None
            assert [("cargo" in one) for one in imported.not_understood] == [True] * cargo
            # It is a sound document, assemblies with their sources included.
            again = Machine.from_document(imported.machine.to_document())
            assert again == imported.machine
            assert_alike(normal_form(again, scenario), normal_form(imported.machine, scenario))


def seats(machine: Machine) -> dict:
    """What each block sits on, blocks named by their places."""
    place = {
        block.id: (block.module.name, *(round(x, 4) + 0.0 for x in block.world_from_block.xyz))
        for block in machine.blocks.values()
    }
    mounts = {place[block.id]: block.mount for block in machine.blocks.values()}
    return {at: mount and (place[mount[0]], mount[1]) for at, mount in mounts.items()}


def test_connections_are_found_by_places() -> None:
    right = wrong = links = 0
    for found in goldens():
        machine = found.machine(controlled=False)
        data = without_script(plain_machine_file(machine, name="m"))
        imported = read_machine_file(data).machine
        theirs, ours = seats(machine), seats(imported)
        for joint in machine.joints:
            block = machine.blocks[joint.part]
            face = machine.blocks[joint.base].face_normal(joint.face)
            upright = sum(a * b for a, b in zip(face, block.axis_xyz, strict=True)) > 0.9999
            if joint.offset < 0.2 and upright:
                key = next(k for k in theirs if k[0] == block.module.name and near(k[1:], block))
                right += ours[key] == theirs[key]
                wrong += ours[key] != theirs[key]
        links += len(imported.connectors)
        # A machine is a machine: nothing overlaps, every base comes before what sits on it.
        assert Machine.from_document(imported.to_document()) == imported
    assert (wrong, right > 700, links > 150) == (0, True, True)


def near(place, block) -> bool:
    return all(abs(a - b) < 1e-3 for a, b in zip(place, block.world_from_block.xyz, strict=True))


def test_published_files_are_read(subtests) -> None:
    for name in published_files():
        with subtests.test(name=name):
            imported = read_machine_file(published_files()[name])
            found = next(one for one in goldens() if one.name == "-".join(name.split("_")[:2]))
            _, _, category, level = name.split("_")
            wanted = (category, level)
            export = next(
                e for e in found.exports if (e["category"], e["level"] or "none") == wanted
            )
            blocks = [b for b in export["blocks"] if b["local_id"] != "Ballast"]
            at = [(b["name"], *(round(x, 4) + 0.0 for x in b["position"])) for b in blocks]
            theirs = sorted(at)
            read = normal_form(imported.machine)["blocks"]
            ours = sorted((b["name"], *(round(x, 4) + 0.0 for x in b["position"])) for b in read)
            assert ours == theirs
            assert "the Lua script is not ours" in imported.not_understood[0]
            keys = sorted(v for b in blocks for k, _, v in b["data"] if k == "StringArray" and v)
            bindings = (v for b in imported.machine.blocks.values() for v in b.bindings.values())
            bound = sorted(sorted(v) for v in bindings if v)
            # The published bridge was saved with the keys of the rocket before it.
            assert bound == keys or category == "support"
            assert imported.name == export["machine"]["name"]


def test_what_is_not_understood_is_named(subtests) -> None:
    for given, says in [
        ({"blocks": block(57)}, ["block 3: no module is of the game's type 57: left out"]),
        (
            {"blocks": block(35, 'x="0" y="0" z="9"')},
            ["block 3 (Ballast): a cargo is the task's: left out"],
        ),
        (
            {"blocks": block(2, data='<Boolean key="bmt-automatic">perhaps</Boolean>')},
            ["block 3 (Powered Wheel): 'bmt-automatic' is 'perhaps', which is no 'Boolean'"],
        ),
        (
            {"blocks": block(2, data='<Single key="bmt-speed">fast</Single>')},
            ["block 3 (Powered Wheel): 'bmt-speed' is 'fast', which is no 'Single'"],
        ),
        (
            {
                "blocks": block(
                    2, data='<StringArray key="bmt-forward"><String>w</String></StringArray>'
                )
            },
            ["block 3 (Powered Wheel): 'bmt-forward': there is no key 'w'"],
        ),
        (
            {"blocks": block(15, data='<String key="bmt-note">x</String>')},
            ["block 3 (Small Wooden Block): 'bmt-note' is not understood"],
        ),
        (
            {"blocks": block(47, place='x="9" y="9" z="9"')},
            ["block 3 (Torch) sits on no face of another block"],
        ),
        ({"data": '<Boolean key="spin">1</Boolean>'}, ["the machine's data 'spin'"]),
        ({"data": '<String key="lua_data">x = 1</String>'}, ["the Lua script is not ours"]),
        ({"version": "2.0"}, ["bsgVersion '2.0' is read as 1.4"]),
        ({"blocks": block(15, place='x="0" y="0" z="0.6"')}, ["would not be read back"]),
    ]:
        with subtests.test(given=given):
            found = foreign(**given).not_understood
            for words in says:
                assert any(words in one for one in found), found


def test_a_connector_without_rotations_finds_its_faces() -> None:
    end = '<Vector3 key="end-position"><X>0.5</X><Y>0.5</Y><Z>-0.5</Z></Vector3>'
    start = '<Vector3 key="start-position"><X>0</X><Y>0</Y><Z>0</Z></Vector3>'
    imported = foreign(block(7, data=start + end))
    (link,) = imported.machine.connectors.values()
    assert (link.start[0], link.start[1]) == ("2", "E")
    assert imported.not_understood == ()
    far = end.replace("-0.5", "-7")
    assert "left out" in foreign(block(7, data=start + far)).not_understood[0]


def test_a_moved_block_makes_the_description_doubtful() -> None:
    machine = vehicle()
    data = plain_machine_file(machine, name="m", controls=[press(1.0, "UpArrow", 1.0)])
    moved = data.replace(b'x="0.5" y="0.0" z="0.0"', b'x="0.6" y="0.0" z="0.0"')
    assert moved != data
    imported = read_machine_file(moved)
    assert "blocks were changed after the script was written" in imported.not_understood[0]
    assert len(imported.machine.control_sequence) == 1
    assert imported.machine.part_count == machine.part_count


def test_a_file_that_the_game_saved_again_is_still_ours() -> None:
    """Numbers in single precision, other signs of quaternions, guids in capitals."""
    machine = golden("single-50").machine(controlled=False)
    data = plain_machine_file(machine, name="m").decode()
    number = re.compile(r'(?<==")-?\d+\.\d+(?:e-?\d+)?(?=")')
    single = number.sub(lambda one: f"{float(np.float32(one[0])):.7g}", data)
    other = re.sub(
        r'<Rotation x="([^"]*)" y="([^"]*)" z="([^"]*)" w="([^"]*)" />',
        lambda q: "<Rotation {} />".format(
            " ".join(f'{axis}="{-float(v)}"' for axis, v in zip("xyzw", q.groups(), strict=True))
        ),
        single,
    )
    assert single != data != other
    for text in (single, other):
        imported = read_machine_file(text.encode())
        assert imported.not_understood == ()
        mounts = {key: one.mount for key, one in imported.machine.blocks.items()}
        assert mounts == {key: one.mount for key, one in machine.blocks.items()}


def test_a_description_that_does_not_fit_is_not_believed(subtests) -> None:
    for old, new in [
        (b"&quot;mount&quot;:[&quot;1&quot;", b"&quot;mount&quot;:[&quot;9&quot;"),
        (
            b"&quot;mount&quot;:[&quot;1&quot;,&quot;A&quot;",
            b"&quot;mount&quot;:[&quot;1&quot;,&quot;Z&quot;",
        ),
        (b"&quot;order&quot;:[&quot;1&quot;,", b"&quot;order&quot;:["),
        (b"&quot;next_id&quot;:5", b"&quot;next_id&quot;:2"),
        (b"&quot;next_id&quot;:5", b"&quot;next_id&quot;:1e999"),
        (b"&quot;structures&quot;:[]", b"&quot;structures&quot;:[[1,2,3]]"),
        (b"&quot;version&quot;:1", b"&quot;version&quot;:7"),
        (b"buildarena machine {", b"buildarena machine {{"),
    ]:
        with subtests.test(old=old):
            data = plain_machine_file(vehicle(), name="m")
            assert old in data
            imported = read_machine_file(data.replace(old, new, 1))
            assert any("description is not believed" in one for one in imported.not_understood)
            assert imported.machine.part_count == 4
            assert all(b.mount for b in list(imported.machine.blocks.values())[1:])


def test_files_are_told_apart_by_content() -> None:
    file = plain_machine_file(vehicle(), name="m")
    utf16 = file.decode().replace('encoding="utf-8"', 'encoding="utf-16"').encode("utf-16")
    document = json.dumps(vehicle().to_document()).encode()
    for data in (file, b"\xef\xbb\xbf" + file, utf16, document, b"\xef\xbb\xbf" + document):
        assert read_any_machine(data, where="f").machine.part_count == 4
    with pytest.raises(DocumentError, match=r"^f: not valid JSON"):
        read_any_machine(gzip.compress(file), where="f")


def test_an_assembly_comes_back_with_its_sub_structures() -> None:
    part = vehicle()
    machine = Machine(available={"car": part})
    act(machine, "add_machine", machine_id="car")
    act(machine, "add_machine", machine_id="car", init_shift=[0, 6, 0])
    ends = {"block_a": "A_1", "face_a": "E", "block_b": "B_1", "face_b": "F"}
    act(machine, "connect_blocks", **ends, connector="Winch")
    imported = read_machine_file(plain_machine_file(machine, name="m")).machine
    assert_alike(contents(imported), contents(machine))
    assert list(imported.available) == ["car"]
    blind = read_machine_file(without_script(plain_machine_file(machine, name="m"))).machine
    assert sorted(blind.blocks) == sorted(machine.blocks)
    mounts = [{key: one.mount for key, one in each.blocks.items()} for each in (blind, machine)]
    assert mounts[0] == mounts[1]
    (link,) = blind.connectors.values()
    assert (link.start, link.end) == (("A_1", "E"), ("B_1", "F"))
    assert Machine.from_document(blind.to_document()) == blind


def test_what_a_persons_file_says_otherwise_is_named() -> None:
    found = read_machine_file(RICH)
    machine, thruster, wheel = found.not_understood[-3:]
    for words in ("requiredMods 1d45bae7-", "tracker.enabled True", "tracker.sample_rate_hz 10"):
        assert words in machine
    assert thruster == (
        "block 2 (Steering Thruster): bmt-left T, UpArrow, M3; bmt-right Keypad8, G, Keypad8; "
        "bmt-fthrust 1.50 (simulated as 3); bmt-auto-brake False; bmt-toggle-mode true; "
        "flipped True"
    )
    assert "bmt-automatic True (simulated as False)" in wheel
    assert "Scale 2 1 1 (simulated as 1 1 1)" in wheel
    assert found.not_understood[:-3] == (
        "the machine's data 'author' is not understood",
        "the machine's data 'groups' is not understood",
        "the machine's data 'path' is not understood",
        "the Lua script is not ours: what it does, and the keys it presses, are not read",
        "block 1 (Starting Block): 'Settings' is not understood",
        "block 3 (Powered Wheel): 'paint' is not understood",
        "block 4: no module is of the game's type 57: left out",
        "block 6 (Brace): 'bmt-hidden' is not understood",
    )
    thrust = {"thrust_left": ("T", "UpArrow", "M3"), "thrust_right": ("Keypad8", "G", "Keypad8")}
    assert found.own_keys == {"2": thrust, "3": {"spinning_forward": ("F",)}}


def test_nothing_of_a_strangers_file_stands_in_ours() -> None:
    """Settings, mods and scripts of strangers would change a trial, and so its score."""
    machine = read_machine_file(RICH).machine
    scenario = builtin_tasks()["transport-1"].scenario
    trial = prepare_run(machine, scenario, name="m", run_id="r").machine_file
    for data in (trial, plain_machine_file(machine, name="m")):
        for word in (
            b"tracker",
            b"1d45bae7",
            b"1.50",
            b"brass",
            b'x="2',
            b"Infinity",
            b"os.execute",
        ):
            assert word not in data


def test_machines_of_files_come_back_from_ours(subtests) -> None:
    for name in ["rich", *published_files()]:
        with subtests.test(name=name):
            assert round_trip(RICH if name == "rich" else published_files()[name])
