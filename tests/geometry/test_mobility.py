"""What meshes, what is locked and by what: told, and the same as simulators find."""

import itertools
import re

import numpy as np
import pytest
from support.machines.building import BLOCK, attach, built, connect
from support.machines.random_workshop import TASKS, random_workshop_machine

from buildarena_geometry import Machine, module_set
from buildarena_geometry.mobility import mobility
from buildarena_simulation.machine import structure_of
from buildarena_simulation.structure.clusters import find_clusters

WORKSHOP = module_set("workshop")


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
    jointed = {
        joint.part
        for joint in machine.joints
        if joint.holds
        and machine.blocks[joint.part].module.physics.joint_type
        in ("axle", "hinge", "slider", "ball", "constant_velocity")
    }
    pairs = {frozenset((a, b)) for a, others in found.meshes.items() for b in others}
    return jointed - set(found.locks), pairs


@pytest.mark.nightly(keep=8)
@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("seed", range(4))
def test_it_agrees_with_the_simulator(task, seed):
    machine = random_workshop_machine(task, seed)
    assert told(machine) == simulated(machine)
    # Braces between any faces lock some joints and leave others.
    draw = np.random.default_rng(seed)
    faced = [block for block in machine.blocks.values() if block.module.faces]
    for _ in range(5):
        a, b = (faced[k] for k in draw.choice(len(faced), 2, replace=False))
        ends = (str(draw.choice(list(block.module.face_of_label))) for block in (a, b))
        face_a, face_b = ends
        connect(machine, a.id, face_a, b.id, face_b)
        assert told(machine) == simulated(machine)


@pytest.mark.parametrize(
    "joint", ["Hinge", "Swivel", "Slider", "Piston", "Suspension", "Ball Joint"]
)
def test_a_brace_across_a_joint_is_told_to_lock_it(joint):
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


@pytest.mark.parametrize("connector", ["Winch", "Spring"])
def test_ropes_and_springs_lock_nothing(connector):
    machine = built(("1", "A", "Hinge"), ("2", "E", BLOCK), catalogue=WORKSHOP)
    assert "locked" not in connect(machine, "1", "C", "3", "E", connector=connector).text


def test_a_deck_on_two_suspensions_does_not_move():
    machine = built(
        ("1", "A", BLOCK), ("1", "C", "Suspension"), ("2", "C", "Suspension"), catalogue=WORKSHOP
    )
    answer = connect(machine, "3", "E", "4", "E")
    assert "Block 3 (Suspension) is locked by 4." in answer.text
    assert "Block 4 (Suspension) is locked by 3." in answer.text


@pytest.mark.parametrize(("faces", "moves"), [(("A", "B"), True), (("A", "C"), False)])
def test_joints_of_a_loop_move_if_they_turn_about_one_line(faces, moves):
    """Swivels on opposite faces turn about one line; on faces at right angles they lock."""
    machine = built(("1", faces[0], "Swivel"), ("1", faces[1], "Swivel"), catalogue=WORKSHOP)
    connect(machine, "2", "E", "3", "E")
    assert told(machine) == simulated(machine)
    assert bool(mobility(machine.state).locks) != moves


COGS = [name for name, module in WORKSHOP.items() if module.gear is not None]


@pytest.mark.parametrize(("first", "second"), list(itertools.product(COGS, repeat=2)))
def test_cogs_are_told_to_mesh_by_the_number_of_the_other(first, second):
    apart = round(sum(WORKSHOP[name].gear.pitch_radius for name in (first, second)))
    row = [("1", "A", BLOCK)] + [(str(k), "E", BLOCK) for k in range(2, apart + 1)]
    machine = built(*row, ("1", "E", first), catalogue=WORKSHOP)
    base, cog = str(apart + 1), str(apart + 2)
    answer = attach(machine, base, _face(machine, base, "North"), second)
    other = str(apart + 3)
    assert f"meshes with {cog}" in answer.text
    assert f"meshes with {other}" in machine.act("get_block_details", {"block_id": cog}).text
    assert told(machine) == simulated(machine)
    shifted = machine.act("shift_block", {"block_id": other, "shift_real": [0.2, 0, 0]})
    assert shifted.text.endswith(f"no longer meshes with {other}.")
    assert told(machine) == simulated(machine)


def _face(machine: Machine, block: str, side: str) -> str:
    text = machine.act("get_block_details", {"block_id": block}).text
    return re.search(rf"(\w+) <{side}>", text).group(1)


def test_a_wheel_that_is_braced_to_the_frame_is_told_to_be_locked():
    machine = built(("1", "A", "Powered Wheel"))
    assert not mobility(machine.state).locks
    assert connect(machine, "1", "C", "2", "E").text.endswith(
        "Block 2 (Powered Wheel) is locked by 3."
    )


@pytest.mark.parametrize("shift", [0.1, 0.25, 0.5])
def test_a_refusal_says_how_deep_the_overlap_is(shift):
    """Colliders of a row leave 0.2 between them along it; what goes beyond is told."""
    machine = built(("1", "A", BLOCK), ("2", "E", BLOCK))
    answer = machine.act("shift_block", {"block_id": "3", "shift_real": [-shift, 0, 0]})
    depth = shift - 0.2
    assert answer.ok == (depth < 0)
    if not answer.ok:
        assert answer.text.endswith(f"block 2 (Small Wooden Block) by {depth:.2g}.")
