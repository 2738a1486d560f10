"""What the stand-in game reads from machine and level files, and what it refuses."""

from __future__ import annotations

import ast
from pathlib import Path

import numpy as np
import pytest
from stand_in_game.level_file import read_level_file
from stand_in_game.machine_file import GameFileError, read_machine_file
from stand_in_game.rebuilding import rebuild
from stand_in_machines import machine_file

from buildarena_geometry import Machine
from buildarena_simulation.scenario import gap_terrain

SAVED = Path(__file__).parents[1] / "data" / "besiege" / "bsg"
PACKAGE = Path(__file__).parents[1] / "support" / "stand_in_game"

LEVEL = """\ufeff<?xml version="1.0" encoding="utf-8"?><Level><LevelSettings /><Objects>
<Object ID="-1" Prefab="7000"><Position x="0" y="0" z="12.5" /><Scale x="30" y="5" z="20" />
<Data><Boolean key="bmt-lel-enable-physics">False</Boolean></Data></Object>
<Object ID="-2" Prefab="7000"><Position x="0" y="0" z="-12.5" />
<Scale x="30" y="5" z="20" /></Object>
<Object ID="3" Prefab="9001"><Position x="0" y="5.05" z="0" /></Object></Objects></Level>"""


def built(*steps: tuple[str, dict[str, object]]) -> Machine:
    machine = Machine()
    for name, arguments in (("start", {}), *steps):
        outcome = machine.act(name, arguments)
        assert outcome.ok, outcome
    return machine


def attach(base: str, face: str, block: str) -> tuple[str, dict[str, object]]:
    return ("attach_block_to", {"base_block": base, "face": face, "new_block": block})


def connect(a: str, face_a: str, b: str, face_b: str, kind: str) -> tuple[str, dict[str, object]]:
    ends = {"block_a": a, "face_a": face_a, "block_b": b, "face_b": face_b}
    return ("connect_blocks", {**ends, "connector": kind})


VARIED = (
    attach("1", "E", "Small Wooden Block"),
    attach("2", "A", "Powered Wheel"),
    attach("2", "B", "Powered Wheel"),
    attach("1", "D", "Small Wooden Block"),
    attach("5", "C", "Water Cannon"),
    attach("1", "C", "Torch"),
    attach("3", "E", "Small Wooden Block"),
    connect("5", "E", "2", "D", "Brace"),
    connect("1", "F", "8", "E", "Winch"),
    ("twist_block", {"block_id": "3", "angle": 30}),
    ("shift_block", {"block_id": "8", "shift_real": [0.1, 0.2, 0]}),
    ("flip_spin", {"block_id": "4"}),
)


def reread(text: str, folder: Path) -> Machine:
    path = folder / "machine.bsg"
    path.write_text(text)
    return rebuild(read_machine_file(path)).machine


def test_the_package_shares_nothing_with_our_own_reader_and_writer() -> None:
    for path in PACKAGE.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            names = [name.name for name in getattr(node, "names", [])]
            module = getattr(node, "module", None) or ""
            assert not any("buildarena_besiege" in name for name in (*names, module)), path


@pytest.mark.parametrize("turned_ends", [True, False])
def test_a_machine_comes_back_with_its_mounts_and_connectors(
    tmp_path: Path, turned_ends: bool
) -> None:
    machine = built(*VARIED)
    found = reread(machine_file(machine, turned_ends=turned_ends), tmp_path)
    names = dict(zip(found.blocks, machine.blocks, strict=True))
    for mine, block in zip(machine.blocks.values(), found.blocks.values(), strict=True):
        assert block.module == mine.module
        assert block.flipped == mine.flipped
        assert np.allclose(block.center, mine.center, atol=1e-6)
        assert np.allclose(block.world_from_block.rotation, mine.world_from_block.rotation)
        mount = None if block.mount is None else (names[block.mount[0]], block.mount[1])
        assert mount == mine.mount
    assert [joint.holds for joint in found.joints] == [joint.holds for joint in machine.joints]
    for link, own in zip(found.connectors.values(), machine.connectors.values(), strict=True):
        assert (names[link.start[0]], link.start[1]) == own.start
        assert (names[link.end[0]], link.end[1]) == own.end
        assert link.module == own.module


def test_blocks_whose_base_was_removed_fall_by_themselves(tmp_path: Path) -> None:
    machine = built(
        attach("1", "E", "Small Wooden Block"),
        attach("2", "E", "Small Wooden Block"),
        attach("3", "E", "Small Wooden Block"),
        ("remove_block", {"block_id": "2"}),
    )
    found = reread(machine_file(machine), tmp_path)
    assert [block.mount for block in found.blocks.values()] == [None, None, ("1", "E")]


@pytest.mark.parametrize(
    ("name", "counts"),
    [
        ("single_1_transport_hard", (26, 22, 3, 25)),
        ("single_5_support_soft", (36, 31, 5, None)),
        ("single_5_transport_medium", (37, 31, 5, 36)),
    ],
)
def test_files_the_published_library_saved_are_read(
    name: str, counts: tuple[int, int, int, int | None]
) -> None:
    file = read_machine_file(SAVED / f"{name}.bsg")
    rebuilt = rebuild(file)
    machine = rebuilt.machine
    found = (len(file.blocks), len(machine.blocks), len(machine.connectors), rebuilt.cargo)
    if name == "single_5_support_soft":
        found = (len(file.blocks) - (rebuilt.cargo is not None), *found[1:3], None)
    assert found == counts
    assert rebuilt.left_out == ()
    assert max(joint.offset for joint in machine.joints) <= 0.11 + 1e-9
    assert file.script == "SCRIPT TEXT LEFT OUT"
    assert file.position[1] == 5.0 or "support" in name
    assert all(block.ref_key.endswith(block.guid[:8]) for block in file.blocks)


def test_keys_and_cargo_of_a_saved_file() -> None:
    file = read_machine_file(SAVED / "single_1_transport_hard.bsg")
    cannon, cargo = file.blocks[3], file.blocks[-1]
    assert cannon.keys("bmt-shoot") == ("RightArrow", "UpArrow")
    assert cargo.type_id == 35
    assert cargo.scale == (4.0, 8.0, 1.5)
    assert cargo.data["bmt-mass"] == 5.0
    wheel = next(block for block in file.blocks if block.type_id == 2)
    assert wheel.keys("bmt-forward") == ()
    assert wheel.data["flipped"] is False


def test_a_script_is_read_as_it_was_written(tmp_path: Path) -> None:
    script = "-- saved <today>\nif 1 >= 0 and 'a' < \"b\" then\n\tprint(1 & 'x')\nend\n"
    path = tmp_path / "machine.bsg"
    path.write_text(machine_file(built(), script=script))
    assert read_machine_file(path).script == script


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("<Machine ", "<Machines "), "not XML"),
        (("Machine", "Level"), "expected a Machine at the root, found Level"),
        (("<Scale", "<Skale"), "Transform has no Scale"),
        (('y="5.0"', 'y="five"'), "Position: y is no number: 'five'"),
        (('y="5.0"', 'y="nan"'), "y is not finite"),
        (('id="0"', 'id="first"'), "id is no type's number: 'first'"),
        (('id="0"', 'id="15"'), "no starting block"),
        (("False", "no"), "Boolean flipped: not True or False: 'no'"),
        (('w="1.0"', 'w="0.0"'), "a quaternion of length 0"),
    ],
)
def test_bad_files_are_refused_with_the_place(
    tmp_path: Path, change: tuple[str, str], message: str
) -> None:
    path = tmp_path / "machine.bsg"
    text = machine_file(built(attach("1", "A", "Powered Wheel")))
    assert change[0] in text
    path.write_text(text.replace(*change))
    with pytest.raises(GameFileError, match=message):
        read_machine_file(path)


def test_an_entity_bomb_is_no_machine(tmp_path: Path) -> None:
    path = tmp_path / "bomb.bsg"
    path.write_text('<!DOCTYPE M [<!ENTITY a "aaaa">]><Machine>&a;</Machine>')
    with pytest.raises(GameFileError, match="not XML the game reads"):
        read_machine_file(path)


def test_a_level_of_two_boxes_is_our_gap(tmp_path: Path) -> None:
    path = tmp_path / "level.blv"
    path.write_text(LEVEL)
    found = sorted(read_level_file(path), key=lambda box: box.center[1])
    assert found == list(gap_terrain(5.0))


def test_a_tilted_box_rises_towards_the_north(tmp_path: Path) -> None:
    path = tmp_path / "level.blv"
    half = np.radians(10) / 2
    turn = f'<Rotation x="{-np.sin(half)}" y="0" z="0" w="{np.cos(half)}" /><Scale x="30"'
    path.write_text(LEVEL.replace('<Scale x="30"', turn, 1))
    assert read_level_file(path)[0].slope_deg == pytest.approx(10.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (('Prefab="9001"', 'Prefab="2"'), "Prefab 2 is not known; known: 7000, 9001"),
        (('<Scale x="30"', '<Rotation x="0" y="1" z="0" w="1" /><Scale x="30"'), "turned other"),
        (("<Objects>", "<Things>"), "not XML"),
    ],
)
def test_bad_levels_are_refused(tmp_path: Path, change: tuple[str, str], message: str) -> None:
    path = tmp_path / "level.blv"
    path.write_text(LEVEL.replace(*change))
    with pytest.raises(GameFileError, match=message):
        read_level_file(path)
