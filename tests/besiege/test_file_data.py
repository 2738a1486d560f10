"""What files of people and of mods say beyond a machine is stored, shown, and written again."""

import json
from xml.etree import ElementTree as ET

import pytest
from support.machine_files import RICH, published_files
from support.machines.building import attach
from tests.besiege.foreign_files import block, foreign
from tests.besiege.playing import act, vehicle
from tests.besiege.round_trips import blocks, entries, lost, round_trip, said

from buildarena_benchmark import builtin_tasks
from buildarena_besiege import (
    MachineFileError,
    plain_machine_file,
    prepare_run,
    read_any_machine,
    read_machine_file,
)
from buildarena_besiege.game_keys import is_game_key
from buildarena_geometry import DocumentError, Machine
from buildarena_simulation import simulate, write_trajectory


def keys(file: bytes, number: int, name: str) -> list[str | None]:
    entry = next(
        e for e in entries(blocks(ET.fromstring(file))[number - 1]) if e.get("key") == name
    )
    return [child.text for child in entry]


@pytest.mark.parametrize("file", published_files())
def test_files_at_hand_go_round_without_a_loss(file) -> None:
    assert round_trip(published_files()[file])


def test_a_file_of_a_person_goes_round_without_a_loss() -> None:
    assert round_trip(RICH)
    imported = read_machine_file(RICH)
    machine, thruster, wheel, brace = (
        line for line in imported.file_data if "no part of the machine" not in line
    )
    for words in ("requiredMods 1d45bae7-", "tracker.enabled True", "tracker.sample_rate_hz 10"):
        assert words in machine
    assert "a Lua script of 16 characters, which is not run" in machine
    assert thruster == (
        "block 2 (Steering Thruster): bmt-left T, UpArrow, M3; bmt-right Keypad8, G, Keypad8; "
        "bmt-fthrust 1.50 (simulated as 3); bmt-auto-brake False; bmt-toggle-mode true; "
        "flipped True"
    )
    assert "bmt-automatic True (simulated as False)" in wheel
    assert "Scale 2 1 1 (simulated as 1 1 1)" in wheel
    assert brace == "block 5 (Brace): bmt-hidden False"
    # Of what is known nothing is called unknown.
    known = ("bmt-", "flipped", "tracker", "requiredMods", "Scale", "there is no key")
    rest = [one for one in imported.not_understood if "bmt-hidden" not in one]
    assert not [remark for remark in rest if any(word in remark for word in known)]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b"<String>M3</String>", b"<String>M4</String>"),
        (b"<String>M3</String>", b""),
        (b"1.50</Single>", b"1.5</Single>"),
        (b'<Single key="bmt-fthrust">', b'<Integer key="bmt-fthrust">'),
        (b'name="brass', b'name="Brass'),
        (b"<Integer>02</Integer>", b"<Integer>2</Integer>"),
        (b'id="57"', b'id="58"'),
        (b" two  blanks", b"two  blanks"),
        (b"&#13;", b""),
        (b'x="0.50"', b'x="0.5"'),
        (b'bsgVersion="1.4"', b'bsgVersion="1.3"'),
    ],
)
def test_a_loss_would_be_seen(old, new) -> None:
    written = plain_machine_file(read_machine_file(RICH).machine, name="m")
    assert lost(RICH, written) == []
    other = RICH.replace(old, new, 1)
    if b"<Integer key" in new:
        other = other.replace(b"1.50</Single>", b"1.50</Integer>", 1)
    assert other != RICH
    assert lost(other, written)


def test_it_goes_through_a_document_and_a_copy() -> None:
    machine = read_machine_file(RICH).machine
    document = json.dumps(machine.to_document()).encode()
    imported = read_any_machine(document, where="f")
    assert imported.machine == machine.copy() == machine
    assert imported.file_data == read_machine_file(RICH).file_data
    assert plain_machine_file(imported.machine, name="m") == plain_machine_file(machine, name="m")
    bare = Machine.from_document(vehicle().to_document())
    assert "file_data" not in json.dumps(bare.to_document())


def test_a_trial_has_none_of_it() -> None:
    """Settings and mods of a stranger's file would change a trial, and so its score."""
    machine = read_machine_file(RICH).machine
    document = machine.to_document()
    document.pop("file_data")
    for part in (*document["blocks"], *document["connectors"]):
        part.pop("file_data")
    bare = Machine.from_document(document)
    scenario = builtin_tasks()["transport-1"].scenario
    data = prepare_run(machine, scenario, name="m", run_id="r").machine_file
    for word in (b"tracker", b"1d45bae7", b"1.50", b"brass", b'x="2', b"Infinity", b'id="57"'):
        assert word not in data
    assert "file_data" not in str(read_machine_file(data).machine.to_document())
    short = scenario.model_copy(update={"duration_s": 1.0})
    first, second = (write_trajectory(simulate(one, short, "pybullet")) for one in (machine, bare))
    assert first == second


def test_what_is_changed_afterwards_is_written_as_it_is_now() -> None:
    machine = read_machine_file(RICH).machine
    act(machine, "change_control_key", block_id="2", action="thrust_left", new_key="Alpha1")
    act(machine, "flip_spin", block_id="3")
    act(machine, "shift_block", block_id="4", shift_real=[0, 0.25, 0])
    assert attach(machine, "4", "E").ok
    file = plain_machine_file(machine, name="m")
    assert keys(file, 2, "bmt-left") == ["Alpha1", "T", "M3"]
    assert keys(file, 2, "bmt-right") == ["Keypad8", "G", "Keypad8"]
    old, new = (blocks(ET.fromstring(data)) for data in (RICH, file))
    changed = [n for n, (a, b) in enumerate(zip(old, new, strict=False), 1) if said(a) != said(b)]
    assert changed == [2, 3, 5, 6], "the brace ends on the block that was shifted"
    assert len(new) == len(old) + 1
    wheel = {entry.get("key"): entry.text for entry in entries(new[2])}
    assert (wheel["flipped"], wheel["bmt-automatic"]) == ("False", "True")
    back = read_machine_file(file).machine
    assert back.blocks["2"].bindings == machine.blocks["2"].bindings
    assert back.blocks["3"].flipped == machine.blocks["3"].flipped
    assert back.blocks["4"].center_xyz == pytest.approx(machine.blocks["4"].center_xyz)


def test_two_copies_in_an_assembly_have_guids_of_their_own() -> None:
    machine = Machine(available={"rocket": read_machine_file(RICH).machine})
    act(machine, "add_machine", machine_id="rocket")
    act(machine, "add_machine", machine_id="rocket", init_shift=[0, 8, 0])
    file = plain_machine_file(machine, name="m")
    guids = [block.get("guid") for block in blocks(ET.fromstring(file))]
    assert len(guids) == len(set(guids)) == machine.part_count
    assert file.count(b'key="bmt-fthrust"') == 2
    assert round_trip(file)


def test_a_file_of_ours_that_somebody_added_to_keeps_what_was_added() -> None:
    plain = plain_machine_file(vehicle(), name="m")
    assert read_machine_file(plain).file_data == ()
    assert "file_data" not in str(read_machine_file(plain).machine.to_document())
    tracked = plain.replace(
        b'<StringArray key="requiredMods" />',
        b'<StringArray key="requiredMods"><String>x~L~1.0.0~Tracker</String></StringArray>'
        b'<Boolean key="tracker.enabled">True</Boolean>',
    )
    faster = plain.replace(
        b'<Single key="bmt-speed">1.0</Single>', b'<Single key="bmt-speed">9</Single>', 1
    )
    moved = plain.replace(b'<Position x="0.0" y="5.0"', b'<Position x="3" y="5.0"', 1)
    for file in (tracked, faster, moved):
        assert file != plain
        assert round_trip(file)
        assert read_machine_file(file).machine.state.file_data


def test_a_machine_without_data_goes_round() -> None:
    before, rest = RICH.split(b"<Data>", 1)
    after = rest.split(b"</Data>", 1)[1]
    for data in (b"<Data>\n </Data>", b"<Data/>", b"", b"<Data>\n None \n</Data>"):
        assert round_trip(before + data + after)


def test_text_of_strangers_never_becomes_lua() -> None:
    evil = "x ]] os.exit() --[["
    data = "".join(
        f'<StringArray key="{key}">{evil}</StringArray>'
        for key in ("lua_data", " lua_data", "LUA_DATA", "buildarena.stored.lua_data", "lua_files")
    )
    imported = foreign(block(15, data=f'<String key="{evil}">{evil}</String>'), data=data)
    file = ET.fromstring(plain_machine_file(imported.machine, name="m"))
    own = [entry for entry in entries(file) if "lua" in entry.get("key", "").lower()]
    assert [e.get("key") for e in own if e.get("key").strip().lower().startswith("lua")] == [
        *("lua_files", "lua_data", "lua_modules_names", "lua_modules_paths", "lua")
    ]
    assert evil not in next(e.text for e in own if e.get("key") == "lua_data")
    assert sum(entry.text == evil for entry in own) == 5


@pytest.mark.parametrize(
    ("place", "text", "says"),
    [
        (0, "<Part", "not valid XML"),
        (0, "<Part place='1'/>", "not one block with its place"),
        (0, "<Block id='0'/>", "begins with 'Block', not Part"),
        (1, "<Part place='-1'><Block id='0'/></Part>", "not one block with its place"),
        (1, "<!DOCTYPE a><Part/>", "document type"),
        (None, "<FileData version='2'/>", "not of version 1"),
        (None, "<FileData version='1'/>", "has no Machine"),
        (None, "<FileData version='1'><Machine/></FileData>", "no Data and Blocks"),
    ],
)
def test_file_data_that_is_none_is_refused_where_it_is_used(place, text, says) -> None:
    document = vehicle().to_document()
    (document if place is None else document["blocks"][place])["file_data"] = text
    machine = Machine.from_document(document)
    with pytest.raises(MachineFileError, match=says):
        plain_machine_file(machine, name="m")
    imported = read_any_machine(json.dumps(document).encode(), where="f")
    assert says == "no Data and Blocks" or any(says in line for line in imported.file_data)


def test_file_data_of_another_type_is_refused() -> None:
    document = vehicle().to_document()
    rich = read_machine_file(RICH).machine.to_document()
    document["blocks"][1]["file_data"] = rich["blocks"][1]["file_data"]
    with pytest.raises(MachineFileError, match="file data of block 2 is of type 91, not"):
        plain_machine_file(Machine.from_document(document), name="m")


def test_its_size_is_bounded() -> None:
    document = vehicle().to_document()
    document["blocks"][0]["file_data"] = "x" * (4 << 20)
    document["file_data"] = "x"
    with pytest.raises(DocumentError, match="file_data: expected at most 4194304 characters"):
        Machine.from_document(document)
    long = f'<String key="k">{"x" * (5 << 20)}</String>'
    imported = foreign(data=long)
    assert any("are not stored with a machine: left out" in one for one in imported.not_understood)
    assert plain_machine_file(imported.machine, name="m")
    document["file_data"] = "\x00"
    document["blocks"][0]["file_data"] = ""
    with pytest.raises(DocumentError, match="NUL"):
        Machine.from_document(document)


def test_keys_have_the_games_names() -> None:
    for name in ("T", "M3", "Keypad8", "F15", "Joystick16Button19", "LeftShift", "KeypadEnter"):
        assert is_game_key(name)
    for name in ("t", "F16", "M9", "Alpha10", "", "Tab "):
        assert not is_game_key(name)
