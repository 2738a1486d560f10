"""Answers tell what is: what holds, what heats what, which face looks where, what was meant."""

import re

import pytest
from support.machines.building import attach, connect

from buildarena_geometry import Cause, Machine, load_catalogue
from buildarena_geometry.feedback.modules import modules_text
from buildarena_geometry.modules.names import CaselessNames

BLOCK = "Small Wooden Block"
COLUMN = (("1", "D", BLOCK), ("2", "E", BLOCK))
CANNON = ("1", "A", "Water Cannon")
TORCH = ("3", "A", "Torch")


@pytest.fixture
def engine(build) -> Machine:
    """Torch 5 flames up at cannon 4: 0.5 below its lower ball's centre, 0.3 nearer than need be."""
    machine = build(*COLUMN, CANNON, TORCH)
    twist(machine, "5", -90)
    return machine


def act(machine: Machine, name: str, **arguments: object):
    outcome = machine.act(name, arguments)
    assert outcome.ok, outcome.text
    return outcome.text


def shift(machine: Machine, block: str, *by: float) -> str:
    return act(machine, "shift_block", block_id=block, shift_real=list(by))


def twist(machine: Machine, block: str, angle: float) -> str:
    return act(machine, "twist_block", block_id=block, angle=angle)


def details(machine: Machine, block: str) -> str:
    return act(machine, "get_block_details", block_id=block)


# What holds


def test_a_shifted_block_says_how_far_off_it_is_and_that_it_holds(build):
    machine = build(("1", "A", BLOCK), ("2", "E", BLOCK))
    moved = shift(machine, "3", 0, 0.25, 0)
    assert "0.25 off 2/E; still holds" in moved
    for asked in (details(machine, "3"), act(machine, "get_machine_summary")):
        assert "3 Small Wooden Block, 0.25 off 2/E; still holds" in asked
    back = shift(machine, "3", 0, -0.25, 0)
    assert "Block 3 sits flush on 2/E again." in back
    assert "off" not in back


def test_a_parted_block_says_what_that_means(build):
    machine = build(("1", "A", BLOCK), ("2", "E", BLOCK))
    moved = shift(machine, "2", 0, 0.5, 0.5)
    assert "2 Small Wooden Block, 0.71 off 1/A; no longer joined" in moved
    assert "Block 3 is 0.71 off 2/E; no longer joined." in moved
    assert moved.count("there is no joint: without connectors the two come apart") == 1
    assert moved.endswith("Not connected to block 1: 2, 3.")


def test_a_parted_block_that_a_connector_holds_is_not_called_loose(build):
    machine = build(("1", "A", BLOCK))
    assert connect(machine, "1", "C", "2", "C").ok
    moved = shift(machine, "2", 0, 0.5, 0.5)
    assert "no longer joined" in moved
    assert "Not connected" not in moved


def test_what_is_just_too_far_is_not_shown_as_just_near_enough(build):
    machine = build(("1", "A", BLOCK))
    shift(machine, "2", 0.4, 0, 0)
    moved = shift(machine, "2", 0.102, 0, 0)
    assert "0.502 off 1/A; no longer joined" in moved


# What heats what


def test_cannon_and_torch_tell_each_that_the_flame_reaches(engine):
    assert "heats 4" in details(engine, "5")
    assert "heated by 5" in details(engine, "4")
    summary = act(engine, "get_machine_summary")
    assert "heats 4" in summary
    assert "heated by 5" in summary
    assert "heat" not in details(engine, "3")


def test_an_attach_tells_whether_the_flame_reaches(engine):
    act(engine, "remove_block", block_id="4")
    near = act(engine, "attach_block_to", base_block="1", face="A", new_block="Water Cannon")
    assert "heated by 5" in near
    away = act(engine, "attach_block_to", base_block="1", face="B", new_block="Water Cannon")
    assert "not heated" in away


def test_a_twist_away_ends_it_and_a_twist_back_begins_it(engine):
    away = twist(engine, "5", 180)
    assert "heats nothing" in away
    assert "Block 4 (Water Cannon) is no longer heated by 5." in away
    assert "not heated" in details(engine, "4")
    back = twist(engine, "5", 180)
    assert "heats 4" in back
    assert "no longer" not in back


@pytest.mark.parametrize(("apart", "reached"), [(0.3, True), (0.31, False)])
@pytest.mark.parametrize("block", ["4", "5"])
def test_a_shift_ends_it_just_beyond_the_flames_radius(engine, block, apart, reached):
    moved = shift(engine, block, 0, 0, apart if block == "4" else -apart)
    ended = "Block 4 (Water Cannon) is no longer heated by 5." in moved
    assert ended is not reached
    assert ("heated by 5" in details(engine, "4")) is reached


def test_a_removed_torch_leaves_its_cannon_cold_and_a_removed_cannon_is_not_mourned(engine):
    copy = engine.copy()
    gone = act(engine, "remove_block", block_id="5")
    assert "Block 4 (Water Cannon) is no longer heated by 5." in gone
    assert "heat" not in act(copy, "remove_block", block_id="4")
    assert "heats nothing" in details(copy, "5")


def test_a_flame_heats_across_sub_structures_until_one_of_them_leaves(build, engine):
    act(engine, "remove_block", block_id="4")
    cannon = build(("1", "B", "Water Cannon"))
    assembly = Machine(available={"torch": engine, "cannon": cannon})
    assert "heats nothing" in act(assembly, "add_machine", machine_id="torch")
    added = act(assembly, "add_machine", machine_id="cannon", init_shift=[2, 0, 0])
    assert "heated by A_5" in added
    left = act(assembly, "shift_machine", machine_index="A", position=[0, -3, 0])
    assert "heats nothing" in left
    assert "Block B_2 (Water Cannon) is no longer heated by A_5." in left
    back = act(assembly, "shift_machine", machine_index="A", position=[0, 3, 0])
    assert "heats B_2" in back
    gone = act(assembly, "remove_machine", machine_index="A")
    assert "Block B_2 (Water Cannon) is no longer heated by A_5." in gone


# Which face looks where


def shown_free_faces(text: str) -> dict[str, str]:
    listed = text.rpartition("free faces: ")[2] or text.rpartition("Free faces: ")[2]
    return dict(re.findall(r"([A-F]) <([^>]*)>", listed))


@pytest.mark.parametrize("angle", [0, 90, 180, 270])
def test_a_refusal_names_the_free_faces_as_successes_do(build, angle):
    machine = build(("1", "A", BLOCK), ("2", "E", "Torch"))
    twisted = twist(machine, "2", angle)
    faces = dict(re.findall(r"([A-F]) (<[^>]*>) \[[^]]*\](?=;|\.)", details(machine, "2")))
    free = {label: side.strip("<>") for label, side in faces.items()}
    assert set(free) == set("ABCD")
    torch = {"base_block": "2", "new_block": "Torch"}
    taken = machine.act("attach_block_to", {**torch, "face": "E"})
    absent = machine.act("attach_block_to", {**torch, "face": "X"})
    assert taken.cause is Cause.FACE_OCCUPIED
    assert absent.cause is Cause.NO_SUCH_FACE
    assert taken.text.startswith("Face E <East> of block 2")
    assert shown_free_faces(taken.text) == free
    assert shown_free_faces(absent.text) == free
    assert dict(re.findall(r"([A-F]) <([^>]*)>", twisted.partition("Free faces: ")[2])) == free


def test_a_block_without_free_faces_says_so(build):
    machine = build(("1", "A", "Powered Wheel"), ("2", "E", "Torch"))
    refused = attach(machine, "2", "E", BLOCK)
    assert refused.text.endswith("Its free faces: none.")


def test_a_missing_face_of_a_connection_names_all_faces_with_their_sides(build):
    machine = build(("1", "A", BLOCK))
    refused = connect(machine, "1", "G", "2", "C")
    assert "Its faces: A <East>, B <West>, C <Up>, D <Down>, E <North>, F <South>." in refused.text


@pytest.mark.parametrize(
    ("face", "centre"),
    [("A", "[0.75, 0, 0]"), ("B", "[-0.75, 0, 0]"), ("C", "[0, 0, 0.75]")],
)
def test_a_wheel_says_where_its_centre_is(build, face, centre):
    machine = build(("1", face, "Powered Wheel"))
    assert f"centre {centre}" in details(machine, "2")
    moved = shift(machine, "2", 0.1, 0, 0)
    assert f"centre {centre}" not in moved


# What an assembly's parts have


def test_an_added_machine_shows_its_blocks_faces_and_connectors(build):
    cart = build(("1", "A", BLOCK), ("2", "E", BLOCK))
    assert connect(cart, "1", "C", "3", "C", connector="Winch").ok
    assembly = Machine(available={"cart": cart})
    first = act(assembly, "add_machine", machine_id="cart")
    assert first.startswith("Added cart as sub-structure A: 3 blocks A_1 to A_3; connectors: A_4.")
    assert "A_3 Small Wooden Block, on A_2/E, at [2, 0, 0], free faces A <" in first
    assert "\nA_4 Winch, A_1/C [0, 0, 0.5] to A_3/C [" in first
    copy = act(assembly, "add_machine", machine_id="cart", init_shift=[0, 3, 0])
    assert "sub-structure B: 3 blocks B_1 to B_3; connectors: B_4." in copy


def test_a_turned_machine_shows_which_sides_its_faces_look_to_now(build):
    assembly = Machine(available={"cart": build()})
    added = act(assembly, "add_machine", machine_id="cart")
    assert "A <East>" in added
    turned = act(assembly, "rotate_machine", machine_index="A", rotation=[90, 0, 0])
    assert "A <South>" in turned


# Which name is meant


@pytest.mark.parametrize(
    "written", [BLOCK, "small wooden block", "SMALL  WOODEN BLOCK", " Small wooden block "]
)
def test_a_module_is_found_whatever_its_case(build, written):
    machine = build()
    text = act(machine, "attach_block_to", base_block="1", face="A", new_block=written)
    assert text.startswith("Attached. 2 Small Wooden Block")
    assert machine.blocks["2"].module.name == BLOCK


@pytest.mark.parametrize("written", ["Small Wooden", "Wooden Block", "smallwoodenblock", "", " "])
def test_another_name_is_no_module(build, written):
    refused = attach(build(), "1", "A", written)
    assert refused.cause is Cause.UNKNOWN_MODULE


def test_connectors_actions_and_tools_are_found_whatever_their_case(build):
    machine = build(("1", "A", "powered wheel"), ("1", "B", BLOCK))
    ends = {"block_a": "1", "face_a": "C", "block_b": "3", "face_b": "C"}
    assert "4 Brace" in act(machine, "Connect_Blocks", **ends, connector="BRACE")
    bound = {"block_id": "2", "action": "Spinning_Forward", "new_key": "UpArrow"}
    assert "spinning_forward: UpArrow" in act(machine, "change_control_key", **bound)
    assert machine.blocks["2"].bindings["spinning_forward"] == ("UpArrow",)
    misused = attach(machine, "1", "C", "brace")
    assert misused.cause is Cause.CONNECTOR_MISUSE
    assert misused.text.startswith("A Brace")
    swapped = machine.act("connect_blocks", {**ends, "connector": "torch"})
    assert swapped.cause is Cause.BASIC_AS_CONNECTOR


def test_names_that_differ_in_case_alone_are_told_apart():
    names = CaselessNames(["Beam", "beam", "Rod"])
    assert (names.find("Beam"), names.find("beam"), names.find("BEAM")) == ("Beam", "beam", None)
    assert names.find("ROD") == "Rod"


# The module list


def test_the_module_list_gives_sizes_masses_faces_and_actions():
    text = modules_text(load_catalogue())
    for module in load_catalogue().values():
        assert (f"- {module.name} (" in text) is (module.kind != "cargo")
    assert "- Starting Block (1 x 1 x 1; mass 0.25; faces A B C D E F)" in text
    assert "actions spinning_forward, spinning_backward" in text


def test_a_tasks_module_list_has_its_modules_and_the_starting_block_alone():
    lines = modules_text(load_catalogue(), [BLOCK]).splitlines()
    assert [line.partition(" (")[0] for line in lines] == ["- Starting Block", f"- {BLOCK}"]
