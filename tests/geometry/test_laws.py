"""What holds for every machine and every pose, whatever was done to it."""

import itertools
import json
import math
import pickle
from copy import deepcopy

import fcl
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.machines.building import connect

from buildarena_geometry import Machine, replay
from buildarena_geometry.modules.solids import Box
from buildarena_geometry.poses import Pose

ids = st.integers(1, 12).map(str)
labels = st.sampled_from("ABCDEF")
modules = st.sampled_from(["Small Wooden Block", "Powered Wheel", "Water Cannon", "Torch"])
angles = st.sampled_from([-90, 15, 30, 45, 90, 123.456, 180, 360])
offsets = st.sampled_from([-0.5, -0.3, -0.1, 0.0, 0.2, 0.25, 0.4, 0.5])
vectors = st.tuples(offsets, offsets, offsets).map(list)
keys = st.sampled_from(["UpArrow", "Alpha1", "Keypad9", "W"])


def action(name, **arguments):
    return st.tuples(st.just(name), st.fixed_dictionaries(arguments))


def connects(blocks):
    ends = {"block_a": blocks, "face_a": labels, "block_b": blocks, "face_b": labels}
    return action("connect_blocks", **ends, connector=st.sampled_from(["Brace", "Winch"]))


attach = action("attach_block_to", base_block=ids, face=labels, new_block=modules)
actions = st.one_of(
    *[attach] * 6,
    action("twist_block", block_id=ids, angle=angles),
    action("shift_block", block_id=ids, shift_real=vectors),
    action("flip_spin", block_id=ids),
    action("remove_block", block_id=ids),
    connects(ids),
    action(
        "change_control_key",
        block_id=ids,
        action=st.sampled_from(["spinning_forward", "hold_to_fire"]),
        new_key=keys,
    ),
    action("add_control_sequence", time=st.just(1), key=keys, hold_for=st.just(2)),
)
sequences = st.lists(actions, max_size=40)
anew = st.sampled_from([("start", {}), ("reset", {})])
courses = st.lists(st.one_of(*[actions] * 4, anew), max_size=12)

assembly_ids = st.sampled_from(["A_1", "A_2", "A_3", "B_1", "B_2", "1", "2", "3"])
letters = st.sampled_from(["A", "B", "C"])
places = st.tuples(*[st.sampled_from([-3, -1, 0, 0.5, 2, 4])] * 3).map(list)
turns = st.sampled_from([[90, 0, 0], [0, 45, 0], [30, 20, 10], [0, 0, -30]])
assembly_actions = st.one_of(
    action("add_machine", machine_id=st.sampled_from(["row", "cart"]), init_shift=places),
    action("add_machine", machine_id=st.just("cart"), init_rotation=turns),
    action("shift_machine", machine_index=letters, position=places),
    action("rotate_machine", machine_index=letters, rotation=turns),
    action("remove_machine", machine_index=letters),
    action("attach_block_to", base_block=assembly_ids, face=labels, new_block=modules),
    action("twist_block", block_id=assembly_ids, angle=angles),
    action("shift_block", block_id=assembly_ids, shift_real=vectors),
    action("remove_block", block_id=assembly_ids),
    connects(assembly_ids),
)


def run(sequence, **start):
    machine = Machine()
    machine.act("start", start)
    for name, arguments in sequence:
        machine.act(name, arguments)
    return machine


def solids(block):
    """The block's colliders as FCL objects, made here independently of the library's own."""
    for solid in block.module.colliders:
        if isinstance(solid, Box):
            shape, center = fcl.Box(*solid.size), solid.center
        else:  # the basic cylinders stand along z
            shape = fcl.Cylinder(solid.radius, solid.length)
            center = np.add(solid.base, solid.top) / 2
        pose = block.world_from_block
        place = fcl.Transform(pose.rotation, pose.apply(np.array(center)))
        yield fcl.CollisionObject(shape, place)


def overlap_depth(left, right) -> float:
    depth = 0.0
    for one, other in itertools.product(solids(left), solids(right)):
        result = fcl.CollisionResult()
        request = fcl.CollisionRequest(num_max_contacts=100, enable_contact=True)
        fcl.collide(one, other, request, result)
        depth = max([depth, *(contact.penetration_depth for contact in result.contacts)])
    return depth


@settings(max_examples=60)
@given(sequences)
def test_no_two_blocks_of_a_machine_overlap(sequence):
    blocks = run(sequence).blocks.values()
    for left, right in itertools.combinations(blocks, 2):
        assert overlap_depth(left, right) < 1e-6, (left.id, right.id)


@settings(max_examples=60)
@given(sequences)
def test_a_refused_action_leaves_the_machine_as_it_was(sequence):
    machine = run([])
    for name, arguments in sequence:
        before, document = machine.copy(), machine.to_document()
        if not machine.act(name, arguments).ok:
            assert machine == before
            after = machine.to_document()
            del document["log"], after["log"]
            assert after == document


@settings(max_examples=100)
@given(sequences)
def test_replaying_a_log_builds_the_same_machine(sequence):
    machine = run(sequence)
    again = replay(machine.log)
    assert again == machine
    assert again.log == machine.log


@settings(max_examples=100)
@given(sequences)
def test_a_document_brings_back_the_same_machine(sequence):
    machine = run(sequence)
    written = json.dumps(machine.to_document(), allow_nan=False)
    restored = Machine.from_document(json.loads(written))
    assert restored == machine
    assert restored.log == machine.log
    assert json.dumps(restored.to_document()) == written


@settings(max_examples=60)
@given(sequences)
def test_a_restored_machine_goes_on_like_the_original(sequence):
    half = len(sequence) // 2
    machine = run(sequence[:half])
    restored = Machine.from_document(machine.to_document())
    for name, arguments in sequence[half:]:
        ours, theirs = machine.act(name, arguments), restored.act(name, arguments)
        assert (ours.ok, ours.text) == (theirs.ok, theirs.text)
    assert restored == machine


def done(machine, course) -> list[str]:
    return [machine.act(name, arguments).text for name, arguments in course]


@settings(max_examples=30)
@given(first=courses, then=courses)
@pytest.mark.parametrize(
    "again", [Machine.copy, deepcopy, lambda machine: pickle.loads(pickle.dumps(machine))]
)
def test_a_copy_goes_on_like_the_original_and_for_itself(again, first, then):
    machine = run(first)
    copy = again(machine)
    assert (copy, copy.log) == (machine, machine.log)
    assert done(copy, then) == done(machine, then)


@settings(max_examples=60)
@given(first=courses, astray=courses, then=courses)
def test_a_machine_that_went_back_goes_on_like_a_copy(first, astray, then):
    machine = run(first)
    kept = machine.log
    copy = machine.copy()
    done(machine, astray)
    machine.return_to(kept)
    assert machine.log == copy.log
    assert done(machine, then) == done(copy, then)
    assert machine.to_document() == copy.to_document()


@settings(max_examples=60)
@given(sequences)
def test_verdicts_and_refusals_do_not_depend_on_where_the_machine_stands(sequence):
    here = run([])
    there = run([], init_shift=[7.0, -3.0, 11.0])
    for name, arguments in sequence:
        ours, theirs = here.act(name, arguments), there.act(name, arguments)
        assert ours.ok == theirs.ok
        if not ours.ok:
            assert ours.text == theirs.text


@settings(max_examples=60)
@given(sequences, st.sampled_from([[90, 0, 0], [0, 90, 0], [0, 0, 180], [30, 20, 10]]))
def test_verdicts_do_not_depend_on_how_the_machine_is_turned(sequence, rotation):
    upright, turned = run([]), run([], init_rotation=rotation)
    for name, arguments in sequence:
        if name == "shift_block":
            continue  # shifts are given in the world's directions
        ours, theirs = upright.act(name, arguments), turned.act(name, arguments)
        assert ours.ok == theirs.ok, (name, arguments, ours.text, theirs.text)
    motion = turned.blocks["1"].world_from_block
    for block_id, block in upright.blocks.items():
        moved = motion @ block.world_from_block
        assert np.allclose(moved.position, turned.blocks[block_id].world_from_block.position)
        assert np.allclose(moved.rotation, turned.blocks[block_id].world_from_block.rotation)


@settings(max_examples=60)
@given(sequences)
def test_each_face_holds_at_most_one_block_and_mass_adds_up(sequence):
    machine = run(sequence)
    mounts = [block.mount for block in machine.blocks.values() if block.mount is not None]
    assert len(mounts) == len(set(mounts))
    assert all(base in machine.blocks for base, _ in mounts)
    assert len(machine.joints) == len(mounts)
    parts = [*machine.blocks.values(), *machine.connectors.values()]
    assert machine.mass == pytest.approx(sum(part.module.mass for part in parts))
    assert machine.part_count == len(parts) == len({part.id for part in parts})


@settings(max_examples=80)
@given(st.lists(assembly_actions, max_size=30))
def test_the_laws_hold_for_assemblies_too(sequence):
    row = run([("attach_block_to", {"base_block": "1", "face": "A", "new_block": "Torch"})])
    wheel = {"base_block": "1", "face": "C", "new_block": "Powered Wheel"}
    cart = run([("attach_block_to", wheel)])
    assembly = Machine(available={"row": row, "cart": cart})
    for name, arguments in sequence:
        before = assembly.copy()
        if not assembly.act(name, arguments).ok:
            assert assembly == before
    for left, right in itertools.combinations(assembly.blocks.values(), 2):
        assert overlap_depth(left, right) < 1e-6, (left.id, right.id)
    for link in assembly.connectors.values():
        assert np.allclose(link.start_xyz, end_of(assembly, link.start))
        assert np.allclose(link.end_xyz, end_of(assembly, link.end))
    assert replay(assembly.log) == assembly
    written = json.dumps(assembly.to_document(), allow_nan=False)
    assert Machine.from_document(json.loads(written)) == assembly


def end_of(machine, face):
    block, label = face
    return machine.blocks[block].face_center(label)


coordinates = st.floats(-100, 100)
points = st.tuples(coordinates, coordinates, coordinates)
quaternions = st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: math.hypot(*q) > 0.01)
poses = st.builds(lambda p, q: Pose(position=p, quaternion=q), points, quaternions)


def assert_close(left: Pose, right: Pose):
    assert np.allclose(left.position, right.position, atol=1e-9)
    assert np.allclose(left.rotation, right.rotation, atol=1e-12)


@given(poses)
def test_a_pose_and_its_inverse_cancel(pose):
    assert_close(pose @ pose.inverse(), Pose())
    assert_close(pose.inverse() @ pose, Pose())


@given(poses, poses, points)
def test_a_composition_acts_like_its_parts_one_after_the_other(a, b, point):
    assert np.allclose((a @ b).apply(point), a.apply(b.apply(point)), atol=1e-9)


@given(poses)
def test_opposite_quaternions_make_equal_poses(pose):
    assert_close(Pose(position=pose.position, quaternion=[-part for part in pose.wxyz]), pose)


def test_a_quarter_turn_about_the_vertical_takes_east_to_north():
    quarter = Pose(quaternion=(1, 0, 0, 1))
    assert np.allclose(quarter.apply((1, 0, 0)), (0, 1, 0))


def test_a_pose_refuses_parts_that_are_none(subtests):
    for position, quaternion, message in [
        ((1, 2), (1, 0, 0, 0), "three finite numbers"),
        ((1, 2, math.nan), (1, 0, 0, 0), "three finite numbers"),
        ((1, 2, 3), (1, 0, 0), "four finite numbers"),
        ((1, 2, 3), (1, 0, 0, math.inf), "four finite numbers"),
        ((1, 2, 3), (0, 0, 0, 0), "has a length"),
    ]:
        with subtests.test(position=position), pytest.raises(ValueError, match=message):
            Pose(position=position, quaternion=quaternion)


def test_the_center_of_mass_weighs_blocks_and_connectors(build):
    machine = build(("1", "A", "Small Wooden Block"), ("1", "C", "Torch"))
    connect(machine, "1", "E", "2", "B")
    link = machine.connectors["4"]
    middle = np.add(link.start_xyz, link.end_xyz) / 2
    weighed = 0.3 * np.array((1, 0, 0)) + 1.0 * np.array((0, 0, 1)) + 0.5 * middle
    assert np.allclose(machine.center_of_mass, weighed / (0.25 + 0.3 + 1.0 + 0.5))


def test_bounds_enclose_the_bodies_and_not_the_colliders(build):
    machine = build(("1", "A", "Powered Wheel"))
    assert np.allclose(machine.bounds, [(-0.5, -1, -1), (1.0, 1, 1)])


def test_a_turned_wheels_bounds_are_those_of_a_cylinder(build):
    machine = build(("1", "A", "Powered Wheel"), init_rotation=[45, 0, 0])
    # The disc stands upright and diagonal: its rim reaches 1 up, and 1/sqrt(2) to each side.
    assert machine.bounds[1, 2] == pytest.approx(1.0)
    rim = 0.5**0.5
    outer = 1.0 * rim  # the outer end's centre lies 1.0 along the axle from the starting block
    assert machine.bounds[1, 0] == pytest.approx(outer + rim)
