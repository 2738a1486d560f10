"""Twisting, shifting, flipping, and what it does to joints."""

import numpy as np
import pytest
from support.machines.building import connect

from buildarena_geometry import Cause, RefusalClass


def twist(machine, block, angle):
    return machine.act("twist_block", {"block_id": block, "angle": angle})


def shift(machine, block, *offset):
    return machine.act("shift_block", {"block_id": block, "shift_real": list(offset)})


def test_a_twist_is_clockwise_seen_from_outside_and_keeps_the_root(build):
    machine = build(("1", "A", "Torch"))  # on the east face, pointing up
    before = machine.blocks["2"].world_from_block.position
    assert twist(machine, "2", 90).ok
    # Seen from the east, looking west, north is on the right: clockwise from up.
    assert np.allclose(machine.blocks["2"].pointing, (0, 1, 0))
    assert np.allclose(machine.blocks["2"].world_from_block.position, before)


def test_twists_add_up_to_full_turns(build):
    machine = build(("1", "A", "Small Wooden Block"))
    before = machine.copy()
    for _ in range(8):
        assert twist(machine, "2", 45).ok
    rotation, whole = (m.blocks["2"].world_from_block.rotation for m in (machine, before))
    assert np.allclose(rotation, whole)
    assert twist(machine, "2", -720).ok


def test_a_block_twists_about_its_base_face_as_that_face_looks_now(build):
    machine = build(("1", "C", "Small Wooden Block"), ("2", "C", "Small Wooden Block"))
    assert twist(machine, "2", 90).ok
    axis = machine.blocks["2"].face_normal("C")
    assert twist(machine, "3", 30).ok
    turn = machine.blocks["3"].world_from_block.rotation
    before = build(("1", "C", "Small Wooden Block"), ("2", "C", "Small Wooden Block"))
    change = turn @ before.blocks["3"].world_from_block.rotation.T
    assert np.allclose(change @ axis, axis)


def test_blocks_that_hang_on_a_moved_block_stay_and_are_named(build):
    machine = build(("1", "A", "Small Wooden Block"), ("2", "E", "Small Wooden Block"))
    before = machine.blocks["3"]
    outcome = shift(machine, "2", 0, 0.3, 0)
    assert machine.blocks["3"] == before
    assert "2 Small Wooden Block, 0.3 off 1/A; still holds" in outcome.text
    assert "Block 3 is 0.3 off 2/E; still holds." in outcome.text


def test_a_joint_gives_up_when_its_sides_are_more_than_half_a_unit_apart(build):
    machine = build(("1", "A", "Torch"))
    assert shift(machine, "2", 0.5, 0, 0).ok
    assert machine.joints[0].offset == pytest.approx(0.5)
    assert machine.joints[0].holds
    assert machine.detached == ()
    outcome = shift(machine, "2", 0.01, 0, 0)
    assert not machine.joints[0].holds
    assert machine.detached == ("2",)
    assert "0.51 off 1/A; no longer joined" in outcome.text


def test_the_center_follows_a_shift(build):
    machine = build(("1", "E", "Water Cannon"))
    before = machine.blocks["2"].center
    shift(machine, "2", 0.1, 0.2, 0.3)
    assert np.allclose(machine.blocks["2"].center - before, (0.1, 0.2, 0.3))


@pytest.mark.parametrize("offset", [(0.51, 0, 0), (0, -0.6, 0), (0, 0, 7)])
def test_a_shift_beyond_half_a_unit_is_out_of_range(build, offset):
    machine = build(("1", "A", "Torch"))
    assert shift(machine, "2", *offset).reason == RefusalClass.OUT_OF_RANGE


def test_the_starting_block_shifts_and_does_not_twist(build):
    machine = build(("1", "A", "Small Wooden Block"))
    assert twist(machine, "1", 90).cause is Cause.START_BLOCK
    outcome = shift(machine, "1", 0, 0.1, 0)
    assert outcome.ok
    assert "Block 2 is 0.1 off 1/A; still holds." in outcome.text


def test_a_connector_turns_in_its_own_frame_and_keeps_its_ends(build):
    machine = build(("1", "A", "Small Wooden Block"))
    connect(machine, "1", "C", "2", "C")
    before = machine.connectors["3"]
    assert twist(machine, "3", 90).ok
    assert shift(machine, "3", 0, 0, 0.2).ok
    after = machine.connectors["3"]
    assert (after.start_xyz, after.end_xyz) == (before.start_xyz, before.end_xyz)
    assert np.allclose(after.world_from_connector.position - before.start_point, (0, 0, 0.2))


def test_flipping_reverses_a_wheel_and_nothing_else(build):
    machine = build(("1", "A", "Powered Wheel"), ("1", "B", "Torch"))
    assert "forward rolls it <North>" in machine.act("get_block_details", {"block_id": 2}).text
    outcome = machine.act("flip_spin", {"block_id": "2"})
    assert machine.blocks["2"].flipped
    assert "forward rolls it <South>" in outcome.text
    assert machine.act("flip_spin", {"block_id": "3"}).reason == RefusalClass.SPIN_CAPABILITY
    assert machine.act("flip_spin", {"block_id": "2"}).ok
    assert not machine.blocks["2"].flipped
