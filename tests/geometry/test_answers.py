"""What answers tell: what holds, heats, meshes, is locked or looks where, and what was meant."""

import re

import numpy as np
import pytest
from support.machines.building import attach, built, connect
from support.machines.random_workshop import TASKS, random_workshop_machine

from buildarena_geometry import Cause, Machine, load_catalogue, module_set
from buildarena_geometry.feedback.modules import modules_text
from buildarena_geometry.mobility import mobility
from buildarena_simulation.machine import structure_of
from buildarena_simulation.structure.clusters import find_clusters

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


# What heats what


@pytest.mark.parametrize(("apart", "reached"), [(0.3, True), (0.31, False)])
@pytest.mark.parametrize("block", ["4", "5"])
def test_a_shift_ends_it_just_beyond_the_flames_radius(engine, block, apart, reached):
    moved = shift(engine, block, 0, 0, apart if block == "4" else -apart)
    ended = "Block 4 (Water Cannon) is no longer heated by 5." in moved
    assert ended is not reached
    assert ("heated by 5" in details(engine, "4")) is reached


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


# Which name is meant


def test_a_module_is_found_whatever_its_case(build, subtests):
    for written in [BLOCK, "small wooden block", "SMALL  WOODEN BLOCK", " Small wooden block "]:
        with subtests.test(written=written):
            machine = build()
            text = act(machine, "attach_block_to", base_block="1", face="A", new_block=written)
            assert text.startswith("Attached. 2 Small Wooden Block")
            assert machine.blocks["2"].module.name == BLOCK


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


# The module list


def test_a_tasks_module_list_has_its_modules_and_the_starting_block_alone():
    lines = modules_text(load_catalogue(), [BLOCK]).splitlines()
    assert [line.partition(" (")[0] for line in lines] == ["- Starting Block", f"- {BLOCK}"]


WORKSHOP = module_set("workshop")


def line(module, face, twist_deg):
    """What is said of a module on a face of a starting block: A looks east, C up, E north.

    Flipped if `twist_deg` is None.
    """
    machine = built(("1", face, module), catalogue=WORKSHOP)
    if twist_deg is None:
        act(machine, "flip_spin", block_id="2")
    elif twist_deg:
        twist(machine, "2", twist_deg)
    return details(machine, "2").splitlines()[0]


def test_directions_are_the_worlds(subtests):
    for module, face, twist_deg, said in [
        ("Hinge", "A", 0, "swings about <North>"),
        ("Hinge", "A", 90, "swings about <Down>"),
        ("Hinge", "A", 30, "swings about <North with -30° pitch>"),
        ("Hinge", "C", 0, "swings about <West>"),
        ("Swivel", "C", 0, "turns freely about <Up>"),
        ("Ball Joint", "A", 0, "turns freely every way"),
        ("Axle", "E", 0, "bends freely, shaft <North>"),
        ("Slider", "E", 45, "slides along <North>"),
        ("Suspension", "D", 0, "slides along <Down>"),
        ("Piston", "B", 0, "extend moves it <West>"),
        ("Steering Block", "A", 0, "turn_left turns it counterclockwise seen from outside"),
        ("Spinning Block", "A", 0, "always turns clockwise seen from outside"),
        ("Steering Hinge", "A", 0, "turn_right swings its far end <Up>"),
        ("Steering Hinge", "A", 90, "turn_right swings its far end <North>"),
        ("Steering Hinge", "A", 180, "turn_right swings its far end <Down>"),
        ("Wheel Unpowered", "A", 0, "turns freely about <East>"),
        ("Small Wheel", "D", 0, "turns freely about <West>"),
        ("Large Wheel", "A", 0, "forward rolls it <North>"),
        ("Fly Wheel", "A", 0, "forward rolls it <South>"),
        ("Wing Panel", "A", 0, "flat side faces <Up>"),
        ("Wing Panel", "A", 90, "flat side faces <North>"),
        ("Drag Block", "A", 0, "open to <Down>"),
        ("Flying Block", "D", 0, "fly pushes it <Down>"),
        ("Steering Hinge", "A", None, "turn_right swings its far end <Down> (flipped)"),
        ("Steering Block", "A", None, "turn_left turns it clockwise seen from outside (flipped)"),
        ("Spinning Block", "A", None, "turns counterclockwise seen from outside (flipped)"),
        ("Large Wheel", "A", None, "forward rolls it <South> (flipped)"),
    ]:
        with subtests.test(module=module):
            told = line(module, face, twist_deg).rstrip(".")
            assert said in told.split(", ") or told.endswith(said)


def simulated(machine: Machine) -> tuple[set[str], set[frozenset[str]]]:
    """The joints that move and the cogs that drive each other, as a simulator finds them."""
    structure = structure_of(machine)
    members = structure.members
    clusters = find_clusters(structure, np.ones(len(members), dtype=bool))
    ids = [part.id for part in structure.parts]
    first, second = (clusters.cluster_of[ends] for ends in (members.first, members.second))
    seated = {ids[members.second[k]] for k in np.flatnonzero(first != second)}
    base = {ids[members.second[k]]: first[k] for k in range(len(members))}
    meshes = {
        frozenset((ids[mesh.first], ids[mesh.second]))
        for mesh in structure.joints.meshes
        if {ids[mesh.first], ids[mesh.second]} <= seated
        and base[ids[mesh.first]] == base[ids[mesh.second]]
    }
    return seated, meshes


def told(machine: Machine) -> tuple[set[str], set[frozenset[str]]]:
    """The same as the library tells it."""
    found = mobility(machine.state)
    turning = ("axle", "hinge", "slider", "ball", "constant_velocity")
    held = [joint.part for joint in machine.joints if joint.holds]
    jointed = {part for part in held if machine.blocks[part].module.physics.joint_type in turning}
    pairs = {frozenset((a, b)) for a, others in found.meshes.items() for b in others}
    return jointed - set(found.locks), pairs


def test_it_agrees_with_the_simulator(subtests):
    for seed, task in enumerate(TASKS[:8]):
        with subtests.test(task=task):
            machine = random_workshop_machine(task, seed % 4)
            assert told(machine) == simulated(machine)
            # Braces between any faces lock some joints and leave others.
            draw = np.random.default_rng(seed)
            faced = [block for block in machine.blocks.values() if block.module.faces]
            for _ in range(5):
                a, b = (faced[k] for k in draw.choice(len(faced), 2, replace=False))
                face_a, face_b = (str(draw.choice(list(b.module.face_of_label))) for b in (a, b))
                connect(machine, a.id, face_a, b.id, face_b)
                assert told(machine) == simulated(machine)


def test_a_brace_across_a_joint_is_told_to_lock_it(subtests):
    for joint in ["Hinge", "Swivel", "Slider", "Piston", "Suspension", "Ball Joint"]:
        with subtests.test(joint=joint):
            machine = built(("1", "A", joint), ("2", "E", BLOCK), catalogue=WORKSHOP)
            if joint in ("Piston", "Suspension"):
                assert "locked" not in machine.act("get_machine_summary", {}).text
            answer = connect(machine, "1", "C", "3", "E")
            assert answer.text.endswith(f"Block 2 ({joint}) is locked by 4.")
            assert "locked by 4" in machine.act("get_block_details", {"block_id": "2"}).text
            assert "locked by 4" in machine.act("get_machine_summary", {}).text
            removed = machine.act("remove_block", {"block_id": "4"})
            assert removed.text.endswith(f"Block 2 ({joint}) can move again.")
            assert "locked" not in machine.act("get_machine_summary", {}).text


def test_joints_of_a_loop_move_if_they_turn_about_one_line(subtests):
    """Swivels on opposite faces turn about one line; on faces at right angles they lock."""
    for faces, moves in [(("A", "B"), True), (("A", "C"), False)]:
        with subtests.test(faces=faces):
            machine = built(*(("1", face, "Swivel") for face in faces[:2]), catalogue=WORKSHOP)
            connect(machine, "2", "E", "3", "E")
            assert told(machine) == simulated(machine)
            assert bool(mobility(machine.state).locks) != moves


COGS = [name for name, module in WORKSHOP.items() if module.gear is not None]


def test_cogs_are_told_to_mesh_by_the_number_of_the_other(subtests):
    for first, second in zip(COGS, [*COGS[1:], COGS[0]], strict=True):
        with subtests.test(first=first, second=second):
            apart = round(sum(WORKSHOP[name].gear.pitch_radius for name in (first, second)))
            row = [("1", "A", BLOCK)] + [(str(k), "E", BLOCK) for k in range(2, apart + 1)]
            machine = built(*row, ("1", "E", first), catalogue=WORKSHOP)
            base, cog, other = (str(apart + number) for number in (1, 2, 3))
            answer = attach(machine, base, _face(machine, base, "North"), second)
            assert f"meshes with {cog}" in answer.text
            assert f"meshes with {other}" in details(machine, cog)
            assert told(machine) == simulated(machine)
            shifted = shift(machine, other, 0.2, 0, 0)
            assert shifted.endswith(f"no longer meshes with {other}.")
            assert told(machine) == simulated(machine)


def _face(machine: Machine, block: str, side: str) -> str:
    text = machine.act("get_block_details", {"block_id": block}).text
    return re.search(rf"(\w+) <{side}>", text).group(1)


def test_a_refusal_says_how_deep_the_overlap_is(subtests):
    """Colliders of a row leave 0.2 between them along it; what goes beyond is told."""
    for shift in [0.1, 0.25, 0.5]:
        with subtests.test(shift=shift):
            machine = built(("1", "A", BLOCK), ("2", "E", BLOCK))
            answer = machine.act("shift_block", {"block_id": "3", "shift_real": [-shift, 0, 0]})
            depth = shift - 0.2
            assert answer.ok == (depth < 0)
            if not answer.ok:
                assert answer.text.endswith(f"block 2 (Small Wooden Block) by {depth:.2g}.")
