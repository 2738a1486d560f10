"""Attaching, connecting, removing, twisting, shifting, flipping, and what it does to joints."""

import numpy as np
import pytest
from support.machines.building import BLOCK, attach, connect

from buildarena_geometry import Machine, RefusalClass, load_catalogue

ATTACHABLE = load_catalogue().attachable


def test_an_unrotated_starting_block_has_the_worlds_axes_and_faces():
    machine = Machine()
    machine.act("start", {"init_shift": [1, 2, 3], "note": "a test"})
    block = machine.blocks["1"]
    assert np.allclose(block.center_xyz, (1, 2, 3))
    assert np.allclose(block.world_from_block.rotation, np.eye(3))
    normals = {face.label: face.normal for face in block.module.faces}
    assert normals["A"] == pytest.approx((1, 0, 0))  # east
    assert normals["C"] == pytest.approx((0, 0, 1))  # up
    assert normals["E"] == pytest.approx((0, 1, 0))  # north
    assert block.note == "a test"


def test_a_new_block_touches_its_base_face_and_points_away_from_it(build, subtests):
    for module in ATTACHABLE:
        for face in "ABCDEF":
            with subtests.test(module=module, face=face):
                machine = build(("1", face, module))
                base, part = machine.blocks["1"], machine.blocks["2"]
                assert part.mount == ("1", face)
                assert np.allclose(part.world_from_block.position, base.face_center(face))
                assert np.allclose(part.axis_xyz, base.face_normal(face))


def test_only_the_face_it_sits_on_is_taken_and_faces_that_touch_a_neighbour_stay_open(build):
    machine = build(("1", "A", "Small Wooden Block"), ("1", "C", "Small Wooden Block"))
    machine.act("attach_block_to", {"base_block": "2", "face": "A", "new_block": "Torch"})
    state = machine.state
    assert state.free_faces(machine.blocks["1"]) == ["B", "D", "E", "F"]
    assert "F" not in state.free_faces(machine.blocks["2"])


def test_ids_count_from_one_and_a_refused_attach_uses_none_up(build):
    machine = build()
    assert not attach(machine, "1", "Z", "Torch").ok
    assert attach(machine, "1", "A", "Torch").changed == ("2",)
    assert not attach(machine, "1", "A", "Torch").ok
    assert machine.act("remove_block", {"block_id": 2}).ok
    assert attach(machine, 1, "A", "Torch").changed == ("3",)


def test_an_overlap_names_every_pair_and_leaves_no_trace(build):
    machine = build(("1", "A", BLOCK), ("2", "E", BLOCK), ("1", "C", BLOCK), ("3", "C", BLOCK))
    before = machine.copy()
    outcome = attach(machine, "2", "C", "Powered Wheel")
    assert outcome.reason == RefusalClass.OVERLAP
    assert set(outcome.overlaps) == {("6", "4"), ("6", "5")}
    assert "block 4" in outcome.text
    assert "block 5" in outcome.text
    assert machine == before
    assert attach(machine, "2", "C").changed == ("6",)


def test_blocks_may_touch_and_not_overlap(build, subtests):
    for gap, fits in [(0.0, True), (-1e-7, True), (-1e-4, False)]:
        with subtests.test(gap=gap):
            machine = build(("1", "A", "Small Wooden Block"), ("2", "E", "Small Wooden Block"))
            # The starting block ends at 0.4, the small block begins at 0.5: 0.1 closes the gap.
            shift = {"block_id": "2", "shift_real": [-0.1 + gap, 0, 0]}
            outcome = machine.act("shift_block", shift)
            assert outcome.ok is fits


def test_a_connector_joins_faces_and_leaves_them_open(build):
    machine = build(("1", "A", "Small Wooden Block"))
    assert connect(machine, "1", "C", "2", "C", connector="Winch").ok
    link = machine.connectors["3"]
    assert link.start == ("1", "C")
    assert np.allclose(link.start_xyz, machine.blocks["1"].face_center("C"))
    assert np.allclose(link.end_xyz, machine.blocks["2"].face_center("C"))
    assert "C" in machine.state.free_faces(machine.blocks["1"])
    assert connect(machine, "1", "A", "2", "E").ok, "taken faces may be connected"


def test_a_connection_that_makes_no_sense_is_refused(build, subtests):
    for arguments, reason in [
        (("1", "A", "2", "F"), RefusalClass.EXCESS_CONNECTION),
        (("2", "F", "1", "A"), RefusalClass.EXCESS_CONNECTION),
        (("1", "C", "1", "C"), RefusalClass.TOO_CLOSE),
        (("1", "C", "3", "A"), RefusalClass.FACE_PRESENCE),
        (("1", "C", "2", "Q"), RefusalClass.FACE_PRESENCE),
        (("7", "C", "2", "A"), RefusalClass.BLOCK_PRESENCE),
    ]:
        with subtests.test(arguments=arguments):
            machine = build(("1", "A", "Small Wooden Block"), ("1", "B", "Torch"))
            assert connect(machine, *arguments).reason is reason


def test_removing_a_block_opens_its_faces_takes_its_connectors_and_names_what_hangs_loose(build):
    machine = build(("1", "A", BLOCK), ("2", "E", BLOCK), ("3", "E", "Torch"))
    connect(machine, "1", "C", "2", "C")
    outcome = machine.act("remove_block", {"block_id": "2"})
    assert outcome.ok
    assert set(outcome.changed) == {"2", "5"}
    assert not machine.connectors
    assert machine.detached == ("3", "4")
    assert "5" in outcome.text
    assert "3, 4" in outcome.text
    assert machine.state.free_faces(machine.blocks["1"]) == list("ABCDEF")
    assert machine.state.free_faces(machine.blocks["3"]) == ["A", "B", "C", "D", "F"]
    assert machine.blocks["3"].mount is None
    assert machine.blocks["3"].lost_mount == ("2", "E")


def twist(machine, block, angle):
    return machine.act("twist_block", {"block_id": block, "angle": angle})


def shift(machine, block, *offset):
    return machine.act("shift_block", {"block_id": block, "shift_real": list(offset)})


def test_a_twist_is_clockwise_seen_from_outside_and_keeps_the_root(build):
    machine = build(("1", "A", "Torch"))  # on the east face, pointing up
    before = machine.blocks["2"].world_from_block.position
    assert twist(machine, "2", 90).ok
    # Seen from the east, looking west, north is on the right: clockwise from up.
    assert np.allclose(machine.blocks["2"].pointing_xyz, (0, 1, 0))
    assert np.allclose(machine.blocks["2"].world_from_block.position, before)


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


def test_a_shift_beyond_half_a_unit_is_out_of_range(build, subtests):
    for offset in [(0.51, 0, 0), (0, -0.6, 0), (0, 0, 7)]:
        with subtests.test(offset=offset):
            machine = build(("1", "A", "Torch"))
            assert shift(machine, "2", *offset).reason == RefusalClass.OUT_OF_RANGE


def test_a_connector_turns_in_its_own_frame_and_keeps_its_ends(build):
    machine = build(("1", "A", "Small Wooden Block"))
    connect(machine, "1", "C", "2", "C")
    before = machine.connectors["3"]
    assert twist(machine, "3", 90).ok
    assert shift(machine, "3", 0, 0, 0.2).ok
    after = machine.connectors["3"]
    assert (after.start_xyz, after.end_xyz) == (before.start_xyz, before.end_xyz)
    assert np.allclose(after.world_from_connector.position - before.start_xyz, (0, 0, 0.2))
