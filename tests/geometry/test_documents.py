"""Machine documents: what they hold, and what they refuse."""

import copy
import json
import math
import random

import pytest
from support.machines.building import connect

from buildarena_geometry import DOCUMENT_VERSION, DocumentError, Machine


@pytest.fixture
def machine(build):
    parts = (("1", "A", "Small Wooden Block"), ("2", "E", "Powered Wheel"))
    built = build(*parts, ("1", "C", "Water Cannon"), ("1", "B", "Torch"))
    connect(built, "1", "E", "2", "D")
    for name, arguments in (
        ("twist_block", {"block_id": "5", "angle": 33.3}),
        ("flip_spin", {"block_id": "3"}),
        ("change_control_key", {"block_id": "4", "action": "hold_to_fire", "new_key": "Alpha1"}),
        ("add_control_sequence", {"time": 0.5, "key": "Alpha1", "hold_for": 2}),
        ("twist_block", {"block_id": "1", "angle": 1}),
    ):
        built.act(name, arguments)
    return built


def test_a_document_tells_version_parts_joints_sequence_and_log(machine):
    document = machine.to_document()
    assert document["version"] == DOCUMENT_VERSION
    assert [block["id"] for block in document["blocks"]] == ["1", "2", "3", "4", "5"]
    assert document["joints"][0] == {"base": "1", "face": "A", "part": "2", "holds": True}
    assert document["connectors"][0]["end"] == ["2", "D"]
    assert document["blocks"][3]["bindings"] == {"hold_to_fire": ["Alpha1"]}
    assert document["control_sequence"] == [{"time_s": 0.5, "key": "Alpha1", "hold_for_s": 2.0}]
    assert document["log"][-1]["reason"] == "block_presence"
    json.dumps(document, allow_nan=False)


def change(path, value):
    def apply(document):
        *parents, last = path
        for key in parents:
            document = document[key]
        document[last] = value

    return apply


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (change(["version"], 99), "document.version: expected version 1"),
        (lambda document: document.pop("log"), "document: log is missing"),
        (change(["colour"], "red"), "unknown field 'colour'"),
        (change(["blocks", 1, "id"], "1"), r"blocks\[1\].id: a block '1' exists already"),
        (change(["blocks", 1, "module"], "Brick"), r"blocks\[1\].module: expected one of"),
        (change(["blocks", 1, "module"], "Brace"), r"blocks\[1\].module: expected one of"),
        (change(["blocks", 1, "mount"], ["9", "A"]), r"blocks\[1\].mount: block '9' does not"),
        (change(["blocks", 1, "mount"], ["1", "Q"]), r"block 1 has no face 'Q'; its faces: A, B"),
        (change(["blocks", 1, "mount"], ["3", "E"]), "block '3' does not come before it"),
        (change(["blocks", 0, "mount"], ["2", "A"]), "a starting block sits on nothing"),
        (change(["blocks", 3, "mount"], ["1", "A"]), "face A of block 1 is used twice"),
        (change(["blocks", 3, "mount"], ["2", "F"]), "face F of block 2 is used twice"),
        (change(["blocks", 1, "position"], [0, 0, math.nan]), "expected a finite number"),
        (change(["blocks", 1, "position"], [0, 0, 1e9]), "expected a position within"),
        (change(["blocks", 1, "quaternion"], [1, 1, 0, 0]), "a quaternion of length 1"),
        (change(["blocks", 1, "flipped"], True), "a Small Wooden Block does not spin"),
        (change(["blocks", 1, "bindings"], {"fly": []}), "has no such action"),
        (change(["blocks", 3, "bindings", "hold_to_fire"], ["W"]), "expected one of UpArrow"),
        (change(["blocks", 1, "position"], [0, 0, 0]), "blocks 1 and 2 overlap"),
        (change(["blocks", 0, "module"], "Small Wooden Block"), "expected 1 starting block"),
        (change(["blocks", 1, "structure"], "A"), "block 2 is of an unknown sub-structure"),
        (change(["connectors", 0, "id"], "2"), "a part '2' exists already"),
        (change(["connectors", 0, "module"], "Torch"), "expected one of Brace, Winch"),
        (change(["connectors", 0, "end"], ["7", "A"]), r"connectors\[0\].end: block"),
        (change(["control_sequence", 0, "key"], "W"), r"control_sequence\[0\].key: expected one"),
        (change(["control_sequence", 0, "time_s"], -1), "expected a number of at least 0"),
        (change(["control_sequence", 0, "hold_for_s"], 0), "expected a number above 0"),
        (change(["next_id"], 3), "expected a number above every id"),
        (change(["log", 0, "reason"], "bad luck"), r"log\[0\].reason: expected one of"),
        (change(["available"], {"x": 1}), "document.available.x: expected an object"),
    ],
)
def test_a_spoilt_document_is_refused_with_its_place_and_what_belongs_there(
    machine, spoil, message
):
    document = json.loads(json.dumps(machine.to_document()))
    spoil(document)
    with pytest.raises(DocumentError, match=message):
        Machine.from_document(document)


@pytest.mark.ci
def test_documents_with_random_damage_are_read_or_refused_and_nothing_else(machine):
    rng = random.Random(7)
    whole = json.loads(json.dumps(machine.to_document()))
    junk = [None, True, -1, 10**400, 0.5, math.nan, "", "1", "\x00", [], [[]], {}, {"": None}]
    refused = 0
    for _ in range(3000):
        document = copy.deepcopy(whole)
        for _ in range(rng.choice([1, 1, 1, 3])):
            spoil(rng, document, rng.choice(junk))
        try:
            Machine.from_document(document)
        except DocumentError:
            refused += 1
    assert refused > 1500


def spoil(rng, node, value):
    """Puts the value somewhere into the document."""
    while True:
        keys = list(node) if isinstance(node, dict) else list(range(len(node)))
        if not keys:
            return
        key = rng.choice(keys)
        child = node[key]
        if not isinstance(child, dict | list) or not child or rng.random() < 0.2:
            node[key] = value
            return
        node = child


def test_a_controller_is_part_of_its_machine() -> None:
    plain = Machine()
    plain.act("start", {})
    steered = plain.with_controller("function control() end")
    assert (steered == plain, plain.controller) == (False, "")
    document = steered.to_document()
    assert "controller" not in plain.to_document()
    assert document["controller"] == "function control() end"
    again = Machine.from_document(document)
    assert again == steered == steered.copy()
    assert again.act("attach_block_to", {"base_block": "1", "face": "A", "new_block": "Torch"}).ok
    assert again.controller == steered.controller
    assert steered.with_controller("") == plain


def test_a_controller_that_cannot_be_stored_is_refused(subtests) -> None:
    for program, words in [
        ("\x00", "without NUL characters"),
        ("\ud800", "lone surrogates"),
        ("é" * 40_000, "at most 65,536 bytes, found 80,000"),
        (5, "controller"),
    ]:
        with subtests.test(program=program):
            document = {**Machine().to_document(), "controller": program}
            with pytest.raises(DocumentError, match=words):
                Machine.from_document(document)
