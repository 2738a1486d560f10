"""What models read, to the letter.

The texts are what the benchmark shows to models: a change of wording makes results incomparable. So
a change needs a new FEEDBACK_VERSION, and then `BUILDARENA_WRITE_GOLDENS=1 pytest <this file>`
writes the golden file anew.
"""

import json
import os
import re
from dataclasses import asdict
from pathlib import Path

import pytest

from buildarena_geometry import FEEDBACK_VERSION, Cause, Machine, load_catalogue, tool_definitions
from buildarena_geometry.feedback.words import caption

GOLDEN = Path(__file__).parents[1] / "data" / "geometry" / "feedback.json"
MODULES = load_catalogue().attachable
BLOCK = "Small Wooden Block"


def run(*actions, available=None):
    """A machine after some actions, given as (name, arguments), and the last outcome."""
    machine = Machine(available=available)
    outcome = None
    for name, arguments in actions:
        outcome = machine.act(name, arguments)
    return machine, outcome


def attach(base, face, module, note=""):
    arguments = {"base_block": base, "face": face, "new_block": module, "note": note}
    return ("attach_block_to", arguments)


def connect(block_a, face_a, block_b, face_b, connector="Brace"):
    ends = {"block_a": block_a, "face_a": face_a, "block_b": block_b, "face_b": face_b}
    return ("connect_blocks", {**ends, "connector": connector})


def twist(block, angle):
    return ("twist_block", {"block_id": block, "angle": angle})


def shift(block, *offset):
    return ("shift_block", {"block_id": block, "shift_real": list(offset)})


def flip(block):
    return ("flip_spin", {"block_id": block})


def details(block):
    return ("get_block_details", {"block_id": block})


def bind(block, action, key):
    return ("change_control_key", {"block_id": block, "action": action, "new_key": key})


def press(time, key, hold_for):
    return ("add_control_sequence", {"time": time, "key": key, "hold_for": hold_for})


def sub(name, letter, **more):
    return (name, {"machine_index": letter, **more})


START = ("start", {"note": "a cart"})
SUMMARY = ("get_machine_summary", {})
CAR = (
    START,
    attach("1", "A", "Powered Wheel", "right"),
    attach("1", "B", "Powered Wheel", "left"),
    attach("1", "F", BLOCK),
    attach("4", "E", "Water Cannon"),
    attach("1", "C", "Torch"),
    flip("3"),
    connect("1", "D", "4", "D"),
    bind("2", "spinning_forward", "UpArrow"),
    bind("3", "spinning_forward", "UpArrow"),
    bind("5", "hold_to_fire", "Alpha1"),
    press(0, "UpArrow", 5.5),
    press(2, "Alpha1", 0.25),
)
BEAM = (START, attach("1", "A", BLOCK), attach("2", "E", BLOCK), attach("3", "E", BLOCK))
ENGINE = (START, attach("1", "D", BLOCK), attach("2", "E", BLOCK), attach("3", "A", "Torch"))
ENGINE += (attach("1", "A", "Water Cannon"), twist("4", -90))
ADD_A = ("add_machine", {"machine_id": "cart"})
ELSEWHERE = {"init_shift": [0, 8, 0], "init_rotation": [90, 0, 0]}
ADD_B = ("add_machine", {"machine_id": "cart", **ELSEWHERE})
JOINED = (ADD_A, ADD_B, connect("A_1", "F", "B_1", "F"))

SEQUENCES = {
    **{
        f"attach {module} to face {face}": (START, attach("1", face, module))
        for module in MODULES
        for face in "ABCDEF"
    },
    **{
        f"attach {module} to a turned block": (
            ("start", {"init_rotation": [30, 20, 10], "init_shift": [1, 2, 3]}),
            attach("1", "A", BLOCK),
            twist("2", 12.5),
            attach("2", "C", module),
        )
        for module in MODULES
    },
    "start": (START,),
    "start with a long note": (("start", {"note": "a  note\nof many words " * 9}),),
    "start elsewhere": (("start", {"init_shift": [1, -2, 0.5], "init_rotation": [45, 0, 0]}),),
    "connect": (*CAR[:5], connect("1", "D", "4", "D")),
    "connect a block with itself": (*BEAM, connect("1", "C", "1", "D")),
    "remove a block": (*BEAM, connect("1", "C", "3", "C"), ("remove_block", {"block_id": "3"})),
    "remove a connector": (*BEAM, connect("1", "C", "3", "C"), ("remove_block", {"block_id": "5"})),
    "reset": (START, ("reset", {})),
    "twist a block": (*BEAM, twist("4", 30)),
    "twist a block that carries others": (*BEAM, attach("3", "C", "Torch"), twist("3", 90)),
    "twist a connector": (*CAR[:8], twist("7", 45)),
    "shift a block": (*BEAM, shift("4", 0, 0.25, -0.1)),
    "shift a block until its joint gives up": (*BEAM, shift("4", 0, 0.5, 0), shift("4", 0, 0.1, 0)),
    "shift a block back": (*BEAM, shift("4", 0, 0.25, 0), shift("4", 0, -0.25, 0)),
    "attach a cannon that is heated": (*ENGINE[:-2], ENGINE[-1], ENGINE[-2]),
    "twist a torch towards a cannon": ENGINE,
    "twist a torch away from a cannon": (*ENGINE, twist("4", 90)),
    "shift a cannon from a flame": (*ENGINE, shift("5", 0, 0, 0.5)),
    "summary of an engine": (*ENGINE, SUMMARY),
    "flip a wheel": (START, attach("1", "A", "Powered Wheel"), flip("2")),
    "flip a flat wheel": (START, attach("1", "D", "Powered Wheel"), flip("2")),
    "bind a key": CAR[:9],
    "add a key": (
        *CAR,
        ("add_control_key", {"block_id": "2", "action": "spinning_forward", "new_key": "Keypad8"}),
    ),
    "add a press": CAR,
    "remove a press": (*CAR, ("remove_control_sequence", {"index": 0})),
    "reset the sequence": (*CAR, ("reset_control_sequence", {})),
    "review powered blocks": (*CAR, ("review_powered_blocks", {})),
    "review the control config": (*CAR, ("review_control_config", {})),
    "review the control sequence": (*CAR, ("review_control_sequence", {})),
    "review nothing powered": (START, ("review_powered_blocks", {})),
    "review no config": (START, ("review_control_config", {})),
    "summary of nothing": (SUMMARY,),
    "summary of a car": (*CAR, SUMMARY),
    "summary with a broken joint": (*BEAM, shift("2", 0, 0.5, 0.3), SUMMARY),
    **{f"details of block {block} of a car": (*CAR, details(block)) for block in "1234567"},
    "add a machine": (ADD_A,),
    "add a turned machine": (ADD_A, ADD_B),
    "shift a machine": (ADD_A, ADD_B, sub("shift_machine", "B", position=[0, 1, 0])),
    "rotate a machine": (ADD_A, ADD_B, sub("rotate_machine", "B", rotation=[0, 0, 90])),
    "remove a machine": (*JOINED, sub("remove_machine", "B")),
    "summary of an assembly": (*JOINED, SUMMARY),
}
REFUSALS = {
    Cause.NOT_STARTED: (attach("1", "A", "Torch"),),
    Cause.ALREADY_STARTED: (START, START),
    Cause.UNKNOWN_MODULE: (START, attach("1", "A", "Steel Beam")),
    Cause.UNKNOWN_CONNECTOR: (*BEAM, connect("1", "C", "2", "C", "Rope")),
    Cause.CONNECTOR_MISUSE: (START, attach("1", "A", "Winch")),
    Cause.BASIC_AS_CONNECTOR: (*BEAM, connect("1", "C", "2", "C", "Torch")),
    Cause.NO_SUCH_BLOCK: (*CAR, details("99")),
    Cause.START_BLOCK: (START, twist("1", 90)),
    Cause.NO_SUCH_FACE: (*BEAM, attach("2", "G", "Torch")),
    Cause.NO_FACES: (*CAR, connect("1", "C", "6", "A")),
    Cause.FACE_OCCUPIED: (*BEAM, attach("2", "E", "Torch")),
    Cause.EXCESS_CONNECTION: (*BEAM, connect("1", "A", "2", "F")),
    Cause.TOO_CLOSE: (*BEAM, connect("1", "C", "1", "C")),
    Cause.NOT_SPINNING: (*CAR, flip("6")),
    Cause.OVERLAP: (*CAR, attach("4", "C", "Powered Wheel"), attach("4", "D", "Powered Wheel")),
    Cause.BAD_KEY: (*CAR, bind("2", "spinning_forward", "W")),
    Cause.NO_LOCOMOTION: (*CAR, bind("6", "hold_to_fire", "UpArrow")),
    Cause.BAD_ACTION: (*CAR, bind("2", "hold_to_fire", "UpArrow")),
    Cause.UNKNOWN_ACTION: (START, ("fly", {})),
    Cause.BAD_INDEX: (*CAR, ("remove_control_sequence", {"index": 2})),
    Cause.OUT_OF_RANGE: (*BEAM, shift("2", 0, 0.75, 0)),
    Cause.MALFORMED_ARGUMENTS: (*BEAM, ("shift_block", {"block_id": "2", "shift_real": "up"})),
    Cause.NO_SUCH_MACHINE: (ADD_A, sub("shift_machine", "Q", position=[0, 1, 0])),
}
FURTHER_REFUSALS = {
    "key that is bound nowhere": (*CAR, press(0, "Keypad3", 1)),
    "press before the start": (*CAR, press(-1, "UpArrow", 1)),
    "start in an assembly": (START,),
    "assembly not begun": (attach("A_1", "A", "Torch"),),
    "unknown machine": (("add_machine", {"machine_id": "boat"}),),
    "machines overlap": (ADD_A, ADD_A),
    "remove the starting block": (START, ("remove_block", {"block_id": "1"})),
    "face of a turned block taken": (
        ("start", {"init_rotation": [30, 20, 10]}),
        attach("1", "A", BLOCK),
        attach("1", "A", BLOCK),
    ),
    "missing argument": (START, ("twist_block", {"block_id": "1"})),
    "unknown argument": (START, ("reset", {"really": True})),
    "number too large": (START, attach("1", "A", "Torch"), twist("2", 1e9)),
}


def texts():
    cart, _ = run(*CAR[:4])
    rendered = {}
    for name, actions in (
        *SEQUENCES.items(),
        *((f"refused: {cause.value}", actions) for cause, actions in REFUSALS.items()),
        *((f"refused: {name}", actions) for name, actions in FURTHER_REFUSALS.items()),
    ):
        uses_machines = any(word in name for word in ("machine", "assembly"))
        available = {"cart": cart} if uses_machines else None
        rendered[name] = run(*actions, available=available)[1]
    return rendered


TEXTS = texts()


@pytest.fixture(scope="module")
def golden():
    now = {
        "version": FEEDBACK_VERSION,
        "texts": {name: outcome.text for name, outcome in TEXTS.items()},
        "tools": [asdict(tool) for tool in tool_definitions()],
    }
    if os.environ.get("BUILDARENA_WRITE_GOLDENS"):
        before = json.loads(GOLDEN.read_text()) if GOLDEN.exists() else {"version": None}
        assert now == before or now["version"] != before["version"], "change FEEDBACK_VERSION first"
        GOLDEN.write_text(json.dumps(now, indent=1, ensure_ascii=False) + "\n")
    return json.loads(GOLDEN.read_text())


def test_models_read_the_golden_texts_and_tools_of_this_version(golden):
    assert golden["version"] == FEEDBACK_VERSION
    assert {name: outcome.text for name, outcome in TEXTS.items()} == golden["texts"]
    assert [asdict(tool) for tool in tool_definitions()] == golden["tools"]


def test_golden_sequences_are_accepted_and_each_cause_has_its_refusal():
    assert [TEXTS[name].text for name in SEQUENCES if not TEXTS[name].ok] == []
    assert [cause for cause in Cause if TEXTS[f"refused: {cause.value}"].cause is not cause] == []


def test_no_text_shows_a_negative_zero():
    assert [n for n, said in TEXTS.items() if re.search(r"-0\.?0*(?![.\d])", said.text)] == []


def test_directions_are_reported_by_compass_and_pitch(subtests):
    for direction, rendered in [
        ((0, 1, 0), "<North>"),
        ((1, 0, 0), "<East>"),
        ((0, -1, 0), "<South>"),
        ((-1, 0, 0), "<West>"),
        ((0, 0, 1), "<Up>"),
        ((0, 0, -1), "<Down>"),
        ((1e-12, 1, -1e-12), "<North>"),
        ((0.5**0.5, 0.5**0.5, 0), "<Northeast 45°>"),
        ((0.6, -0.8, 0), "<Southeast 143.1°>"),
        ((-0.6, -0.8, 0), "<Southwest 216.9°>"),
        ((-0.8, 0.6, 0), "<Northwest 306.9°>"),
        ((0, 0.8, 0.6), "<North with 36.9° pitch>"),
        ((0, -0.6, -0.8), "<South with -53.1° pitch>"),
    ]:
        with subtests.test(direction=direction):
            assert caption(direction) == rendered
