"""The library does what the published library and Besiege do, action by action."""

import gzip
import json
import math
from pathlib import Path

import msgspec
import pytest

from buildarena_geometry.vectors.sequences import run_sequences

DATA = Path(__file__).parents[2] / "data" / "geometry"
POSITION_TOLERANCE = 1.5e-6  # units: what the paper measured against Besiege
ORIENTATION_TOLERANCE_DEG = 2.5e-5  # likewise
NUMBER_TOLERANCE = 1e-6  # of the vectors themselves
PARTS = 4  # tests by file, so that workers share them
EDITS = {"attach_block_to", "connect_blocks", "twist_block", "shift_block", "flip_spin"}


@pytest.fixture(scope="module")
def vectors():
    """Recorded sequences by file, each still JSON: read, all together take 200 MB."""
    return {
        name: msgspec.json.decode(
            gzip.decompress((DATA / f"{name}.json.gz").read_bytes()), type=list[msgspec.Raw]
        )
        for name in ("single", "assembly")
    }


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("name", ["single", "assembly"])
@pytest.mark.parametrize("part", range(PARTS))
def test_every_step_has_the_vectors_verdict_and_state(vectors, name, part):
    for sequence in vectors[name][part::PARTS]:
        assert_sequence(json.loads(bytes(sequence)))


def assert_sequence(sequence):
    compared = steps_to_compare(sequence)
    rendered = next(iter(run_sequences(sequence)))["steps"]
    rebound: set[str] = set()
    for index, (step, ours) in enumerate(zip(compared, rendered, strict=False)):
        if not step.get("overlap", {}).get("robust", True) and ours["kind"] != step["kind"]:
            break  # too close to touching for a verdict; the machines part ways here
        if lost_keys(sequence, index):
            rebound.add(str(step["params"]["block_id"]))
        where = f"seed {sequence['seed']}, step {index}: {step['op']} {step['params']}"
        assert (ours["ok"], ours["kind"]) == (step["ok"], step["kind"]), where
        assert_same_state(ours["state"], step["state"], rebound, where)


@pytest.mark.ci
def test_few_steps_lie_behind_a_known_difference(vectors):
    compared = steps = 0
    for raw in (*vectors["single"], *vectors["assembly"]):
        sequence = json.loads(bytes(raw))
        compared += len(steps_to_compare(sequence))
        steps += len(sequence["steps"])
    assert compared / steps > 0.75


def steps_to_compare(sequence):
    """The steps up to the first one where the published library breaks a rule of ours."""
    lost: set[str] = set()
    for index, step in enumerate(sequence["steps"]):
        lost |= lost_keys(sequence, index)
        uses_lost_key = step["op"] == "add_control_sequence" and step["params"]["key"] in lost
        if uses_lost_key or known_difference(sequence, index):
            return sequence["steps"][:index]
    return sequence["steps"]


def known_difference(sequence, index) -> bool:
    """Whether the published library breaks a rule of ours at this step."""
    step = sequence["steps"][index]
    before = sequence["steps"][index - 1]["state"] if index else {"blocks": []}
    if step["op"] == "shift_block":
        return max(map(abs, step["params"]["shift_real"])) > 0.5
    if step["op"] == "remove_block" and step["ok"]:
        gone = str(step["params"]["block_id"])
        ends = [block["connector"] for block in before["blocks"] if "connector" in block]
        return any(gone in (link["start"][0], link["end"][0]) for link in ends)
    if step["op"] in ("shift_machine", "rotate_machine"):
        # It makes the sub-structures anew from their sources, without what was done to them here.
        return any(past["ok"] and past["op"] in EDITS for past in sequence["steps"][:index])
    return False


def lost_keys(sequence, index) -> set[str]:
    """The keys this step takes from an action; the published library keeps them beside the new."""
    step = sequence["steps"][index]
    if step["op"] != "change_control_key" or not step["ok"]:
        return set()
    blocks = {block["id"]: block for block in sequence["steps"][index - 1]["state"]["blocks"]}
    return set(blocks[str(step["params"]["block_id"])]["keys"][step["params"]["action"]])


def assert_same_state(ours, theirs, rebound, where):
    assert {key: ours[key] for key in ("n", "cost", "next_id")} == {
        key: theirs[key] for key in ("n", "cost", "next_id")
    }, where
    assert ours["mass"] == pytest.approx(theirs["mass"], abs=NUMBER_TOLERANCE), where
    assert ours["control_sequence"] == theirs["control_sequence"], where
    ids = [block["id"] for block in theirs["blocks"]]
    assert [block["id"] for block in ours["blocks"]] == ids, where
    for our, their in zip(ours["blocks"], theirs["blocks"], strict=True):
        assert_same_block(our, their, rebound, f"{where}, block {their['id']}")


def assert_same_block(ours, theirs, rebound, where):
    assert ours.keys() == theirs.keys(), where
    for field in ("name", "flipped", "root_face"):
        assert ours.get(field) == theirs.get(field), where
    if ours["id"] not in rebound:
        assert ours.get("keys") == theirs.get("keys"), where
    for field in ("pos", "center_follow", "virtual"):
        assert math.dist(ours[field], theirs[field]) < POSITION_TOLERANCE, (where, field)
    assert angle_deg(ours["quat"], theirs["quat"]) < ORIENTATION_TOLERANCE_DEG, where
    for field in ("pointing", "spin"):
        if field in theirs:
            assert math.dist(ours[field], theirs[field]) < NUMBER_TOLERANCE, (where, field)
    for label, face in theirs.get("faces", {}).items():
        assert ours["faces"][label]["att"] == face["att"], (where, label)
        assert math.dist(ours["faces"][label]["c"], face["c"]) < POSITION_TOLERANCE, (where, label)
        assert math.dist(ours["faces"][label]["n"], face["n"]) < NUMBER_TOLERANCE, (where, label)
    if "connector" in theirs:
        assert_same_connector(ours["connector"], theirs["connector"], where)


def assert_same_connector(ours, theirs, where):
    assert (ours["start"], ours["end"]) == (theirs["start"], theirs["end"]), where
    for field in ("start_point", "end_point", "projection_virtual"):
        assert math.dist(ours[field], theirs[field]) < POSITION_TOLERANCE, (where, field)


def angle_deg(left, right) -> float:
    """The angle between two unit quaternions, whichever of the two signs they have."""
    apart = min(math.dist(left, right), math.dist(left, [-value for value in right]))
    return math.degrees(4 * math.asin(min(1.0, apart / 2)))
