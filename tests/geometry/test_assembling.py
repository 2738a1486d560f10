"""Whole machines as parts of an assembly, and going back to an earlier value of a machine."""

import numpy as np
import pytest
from support.machines.building import attach, connect

from buildarena_geometry import Machine, RefusalClass


@pytest.fixture
def assembly(build):
    deck = build(("1", "A", "Small Wooden Block"), ("2", "E", "Powered Wheel"))
    connect(deck, "1", "C", "2", "C")
    deck.act("flip_spin", {"block_id": "3"})
    tower = build(("1", "C", "Small Wooden Block"))
    return Machine(available={"deck": deck, "tower": tower})


def add(machine, name, **more):
    return machine.act("add_machine", {"machine_id": name, **more})


def test_blocks_of_a_sub_structure_carry_its_letter(assembly):
    outcome = add(assembly, "deck")
    assert outcome.ok
    assert list(assembly.blocks) == ["A_1", "A_2", "A_3"]
    assert list(assembly.connectors) == ["A_4"]
    assert assembly.blocks["A_3"].mount == ("A_2", "E")
    assert assembly.blocks["A_3"].flipped
    assert assembly.connectors["A_4"].start == ("A_1", "C")
    assert [joint.part for joint in assembly.joints] == ["A_2", "A_3"]


def test_the_same_machine_can_be_added_twice_and_letters_are_never_used_again(assembly):
    add(assembly, "tower")
    add(assembly, "tower", init_shift=[5, 0, 0])
    assert assembly.act("remove_machine", {"machine_index": "A"}).ok
    add(assembly, "tower", init_shift=[10, 0, 0])
    add(assembly, "tower", init_shift=[15, 0, 0])
    assert list(assembly.state.structures) == ["B", "C", "D"]


@pytest.mark.parametrize(
    ("rotation", "east", "north", "up"),
    [
        ([90, 0, 0], "south", "east", "up"),  # yaw: north to east
        ([0, 90, 0], "east", "down", "north"),  # pitch: north down
        ([0, 0, 90], "down", "north", "east"),  # roll: up to east
    ],
)
def test_yaw_pitch_and_roll_turn_as_they_are_said_to(assembly, rotation, east, north, up):
    directions = {"east": (1, 0, 0), "up": (0, 0, 1), "down": (0, 0, -1)}
    directions |= {"north": (0, 1, 0), "south": (0, -1, 0)}
    add(assembly, "tower", init_rotation=rotation)
    turned = assembly.blocks["A_1"].world_from_block.rotation
    wanted = np.array([directions[name] for name in (east, north, up)]).T
    assert np.allclose(turned, wanted)


def test_motions_compose_exactly_about_the_starting_block(assembly):
    add(assembly, "deck", init_shift=[1, 2, 3], init_rotation=[30, 20, 10])
    before = assembly.copy()
    center = assembly.blocks["A_1"].center_xyz
    for _ in range(4):
        assert assembly.act("rotate_machine", {"machine_index": "A", "rotation": [90, 0, 0]}).ok
        assert np.allclose(assembly.blocks["A_1"].center_xyz, center)
    for block_id, block in before.blocks.items():
        now = assembly.blocks[block_id].world_from_block
        assert np.allclose(now.position, block.world_from_block.position)
        assert np.allclose(now.rotation, block.world_from_block.rotation)


def test_what_is_attached_later_moves_along_and_connectors_follow(assembly):
    add(assembly, "deck")
    add(assembly, "tower", init_shift=[0, 6, 0])
    assert attach(assembly, "A_1", "B", "Torch").changed == ("1",)
    connect(assembly, "A_1", "E", "B_1", "F", connector="Winch")
    assembly.act("twist_block", {"block_id": "A_3", "angle": 30})
    before = assembly.copy()
    assert assembly.act("shift_machine", {"machine_index": "A", "position": [0, -2, 1]}).ok
    for block_id in ("1", "A_1", "A_2", "A_3"):
        places = [machine.blocks[block_id].center_xyz for machine in (assembly, before)]
        assert np.allclose(np.subtract(*places), (0, -2, 1))
    link = assembly.connectors["2"]
    assert np.allclose(link.start_xyz, assembly.blocks["A_1"].face_center("E"))
    assert np.allclose(link.end_xyz, before.connectors["2"].end_xyz)
    assert np.allclose(link.world_from_connector.position, link.start_xyz)
    assert np.allclose(link.world_from_connector.apply(link.span), link.end_xyz)


def test_removing_a_sub_structure_takes_what_was_attached_to_it(assembly):
    add(assembly, "deck")
    add(assembly, "tower", init_shift=[0, 6, 0])
    attach(assembly, "A_1", "B", "Torch")
    connect(assembly, "A_1", "E", "B_1", "F")
    assert assembly.detached == ()
    outcome = assembly.act("remove_machine", {"machine_index": "A"})
    assert outcome.ok
    assert list(assembly.blocks) == ["B_1", "B_2"]
    assert not assembly.connectors
    assert add(assembly, "deck").ok, "its place is free again"


def test_unknown_and_empty_machines_can_not_be_added():
    assembly = Machine(available={"hull": Machine()})
    assert add(assembly, "wing").reason == RefusalClass.UNKNOWN_SUB_STRUCTURE
    assert add(assembly, "hull").reason == RefusalClass.UNKNOWN_SUB_STRUCTURE


def test_later_changes_to_a_source_do_not_reach_the_assembly(build):
    source = build()
    assembly = Machine(available={"source": source})
    attach(source, "1", "A", "Torch")
    add(assembly, "source")
    assert list(assembly.blocks) == ["A_1"]


def test_the_twenty_seventh_sub_structure_is_called_aa(build):
    assembly = Machine(available={"cube": build()})
    for index in range(28):
        assert add(assembly, "cube", init_shift=[2 * index, 0, 0]).ok
    assert list(assembly.state.structures)[25:] == ["Z", "AA", "AB"]


def test_moved_blocks_collide_where_they_are_and_not_where_they_were(assembly):
    add(assembly, "tower")
    add(assembly, "tower", init_shift=[0, 5, 0])
    away = {"machine_index": "B", "position": [0, 0, 40]}
    assert assembly.act("shift_machine", away).ok
    assert add(assembly, "tower", init_shift=[0, 5, 0]).ok
    there = add(assembly, "deck", init_shift=[0, 5, 40])
    assert there.reason == RefusalClass.OVERLAP
    assert ("D_1", "B_1") in there.overlaps


def test_what_moved_is_in_nobodys_way_after_a_return(build) -> None:
    machine = build(("1", "A", "Small Wooden Block"))
    kept = machine.log
    for _ in range(3):
        assert machine.act("shift_block", {"block_id": "2", "shift_real": [0.5, 0, 0]}).ok
    machine.return_to(kept)
    assert attach(machine, "2", "E").ok


def test_a_value_of_another_assembly_is_refused() -> None:
    part = Machine()
    part.act("start", {})
    one, other = Machine(available={"part": part}), Machine(available={"part": part})
    one.act("add_machine", {"machine_id": "part"})
    kept = one.log
    one.act("add_machine", {"machine_id": "part", "init_shift": [9, 0, 0]})
    one.return_to(kept)
    assert list(one.blocks) == list(Machine.restored(kept).blocks)
    with pytest.raises(ValueError, match="other sub-structures"):
        other.return_to(kept)
