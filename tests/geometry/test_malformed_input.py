"""Whatever arrives, the dispatcher answers and the machine stays sound."""

import json
import math
import random

import pytest

from buildarena_geometry import Machine, RefusalClass, replay, tool_definitions

TOOLS = {tool.name: tool for tool in tool_definitions()}
JUNK = [
    *(None, True, False, 0, 1, -1, 2, 3.0, 0.5, -0.25, -0.0),
    *(1e300, -1e300, 10**40, -(10**400), 2**63, math.nan, math.inf, -math.inf),
    *("", " ", "1", "2", "99", "A", "E", "a", "é", "\U0001d504", "\x00", "\ud800"),
    *("x" * 501, "x" * 5000, "null", "NaN", "[0, 0, 0]", "UpArrow", "hold_to_fire"),
    *("Torch", "Brace", "Small Wooden Block", "Starting Block"),
    *([], [0], [0, 0, 0], [0.1, 0.2, 0.3], [math.nan, 0, 0], [1e9, 0, 0], [True, 0, 0]),
    *(["0", "0", "0"], [[0], [0], [0]], (0, 0, 0.5)),
    *({}, {"x": 1}, {1: 2}, {"\ud800": 1}, set(), b"1", object(), 1j, int),
]
NAMES = [*TOOLS, "", "Start", "attach", "__init__", "\ud800", "x" * 9999, None, 3, [], {}, object()]
CALLS = 100_000


def nested(depth: int) -> list:
    value: list = []
    for _ in range(depth):
        value = [value]
    return value


def draw_arguments(rng: random.Random, name):
    kind = rng.random()
    if kind < 0.05:
        return rng.choice(JUNK)
    if kind < 0.07:
        return nested(rng.choice([3, 9, 200]))
    tool = TOOLS.get(name) if isinstance(name, str) else None
    named = list(tool.parameters["properties"]) if tool else ["block_id"]
    arguments = {argument: rng.choice(JUNK) for argument in named if rng.random() < 0.9}
    if rng.random() < 0.05:
        arguments[rng.choice(["extra", "\ud800", "Face", ""])] = rng.choice(JUNK)
    return arguments


@pytest.mark.ci
def test_a_hundred_thousand_malformed_calls_raise_nothing_and_break_nothing():
    rng = random.Random(20_260)
    reasons = set()
    wheel = {"base_block": "1", "face": "A", "new_block": "Powered Wheel"}
    cart = Machine()
    cart.act("start")
    cart.act("attach_block_to", wheel)
    for round_number in range(CALLS // 500):
        # Every third machine is an assembly, of machines whose names the junk happens to hit.
        machine = Machine(available={"A": cart, "1": cart} if round_number % 3 == 0 else None)
        machine.act("start")
        machine.act("attach_block_to", wheel)
        machine.act("add_machine", {"machine_id": "A"})
        for _ in range(500):
            name = rng.choice(NAMES)
            outcome = machine.act(name, draw_arguments(rng, name))
            assert isinstance(outcome.text, str)
            assert outcome.text
            if not outcome.ok:
                reasons.add(outcome.reason)
        document = json.loads(json.dumps(machine.to_document(), allow_nan=False))
        assert Machine.from_document(document) == machine
        again = replay(machine.log)
        assert again == machine
        assert [record.reason for record in again.log] == [record.reason for record in machine.log]
    assert reasons >= {
        RefusalClass.MALFORMED_ARGUMENTS,
        RefusalClass.UNKNOWN_ACTION,
        RefusalClass.OUT_OF_RANGE,
        RefusalClass.BAD_KEY,
        RefusalClass.BLOCK_PRESENCE,
        RefusalClass.UNKNOWN_SUB_STRUCTURE,
    }


@pytest.mark.parametrize("value", JUNK, ids=lambda value: type(value).__name__)
@pytest.mark.parametrize(
    ("name", "argument", "others"),
    [
        ("attach_block_to", "face", {"base_block": "1", "new_block": "Torch"}),
        ("twist_block", "angle", {"block_id": "2"}),
        ("shift_block", "shift_real", {"block_id": "2"}),
        ("remove_control_sequence", "index", {}),
    ],
)
def test_junk_in_one_argument_is_accepted_or_refused_with_a_sentence(
    build, name, argument, others, value
):
    machine = build(("1", "A", "Powered Wheel"))
    before = machine.copy()
    outcome = machine.act(name, {**others, argument: value})
    if not outcome.ok:
        assert outcome.text.endswith(".")
        assert machine == before


def test_what_is_no_json_is_kept_in_the_log_as_unreadable(build):
    machine = build()
    machine.act("twist_block", {"block_id": "1", "angle": math.nan, "note": object()})
    assert machine.log[-1].arguments == {
        "block_id": "1",
        "angle": {"unreadable": "nan"},
        "note": {"unreadable": "object"},
    }


def test_an_unknown_argument_is_refused_with_the_known_ones(build):
    outcome = build().act("flip_spin", {"block_id": "1", "speed": 3})
    assert outcome.reason == RefusalClass.MALFORMED_ARGUMENTS
    assert "speed" in outcome.text
    assert "block_id" in outcome.text


def test_a_missing_argument_is_named(build):
    outcome = build().act("twist_block", {"block_id": "1"})
    assert outcome.reason == RefusalClass.MALFORMED_ARGUMENTS
    assert "angle" in outcome.text


def test_a_machine_can_not_wander_out_of_reach_step_by_step(build):
    assembly = Machine(available={"cube": build()})
    assembly.act("add_machine", {"machine_id": "cube", "init_shift": [1e6, 0, 0]})
    before = assembly.copy()
    outcome = assembly.act("shift_machine", {"machine_index": "A", "position": [1e6, 0, 0]})
    assert outcome.reason == RefusalClass.OUT_OF_RANGE
    assert assembly == before
    assert Machine.from_document(assembly.to_document()) == assembly


def test_an_accepted_program_is_in_the_log_as_it_is_however_long(build) -> None:
    machine, program = build(), "function control() return {} end" + "\n-- é" * 9_000
    assert machine.act("set_controller", {"program": program}).ok
    assert machine.log[-1].arguments == {"program": program}
    again = replay(machine.log)
    assert again.controller == program
    assert again.to_document() == machine.to_document()
    refused = machine.act("set_controller", {"program": program * 3})
    assert not refused.ok
    assert machine.log[-1].arguments == {
        "program": {"unreadable": f"text of {3 * len(program)} characters"}
    }
    assert replay(machine.log).to_document() == machine.to_document()
