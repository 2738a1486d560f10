"""Calls: tools and their schemas, keys and sequences, and whatever else may arrive."""

import json
import math
import random

import jsonschema
import pytest

from buildarena_geometry import Cause, Machine, RefusalClass, replay, tool_definitions


def test_an_unknown_group_is_refused_with_the_known_ones():
    with pytest.raises(ValueError, match="unknown group 'move'; valid groups: build, refine"):
        tool_definitions(["move"])


def test_arguments_the_schema_takes_are_read_and_junk_it_refuses_is_refused(subtests):
    for name, arguments in [
        ("start", {"init_shift": [0, 1.5, 0], "note": "x"}),
        ("attach_block_to", {"base_block": "1", "face": "A", "new_block": "Torch"}),
        ("twist_block", {"block_id": "2", "angle": 45}),
        ("shift_block", {"block_id": "2", "shift_real": [0.1, 0, 0]}),
        ("get_machine_summary", {}),
    ]:
        with subtests.test(name=name):
            (schema,) = (tool.parameters for tool in tool_definitions() if tool.name == name)
            jsonschema.validate(arguments, schema)
            machine = Machine()
            taken = machine.act(name, arguments).ok
            assert taken or machine.log.records[-1].reason != "malformed_arguments"
            spoilt = [{**arguments, "more": 1}, *({**arguments, first: {}} for first in arguments)]
            for given in spoilt[1:]:
                with pytest.raises(jsonschema.ValidationError):
                    jsonschema.validate(given, schema)
            for given in spoilt:
                machine.act(name, given)
                assert machine.log.records[-1].reason == "malformed_arguments"


@pytest.fixture
def car(build):
    wheels = (("1", "A", "Powered Wheel"), ("1", "B", "Powered Wheel"))
    return build(*wheels, ("1", "E", "Water Cannon"), ("1", "F", "Torch"))


def bind(machine, block, action, key, name="change_control_key"):
    return machine.act(name, {"block_id": block, "action": action, "new_key": key})


def press(machine, time, key, hold_for):
    arguments = {"time": time, "key": key, "hold_for": hold_for}
    return machine.act("add_control_sequence", arguments)


def test_changing_a_key_replaces_and_adding_one_adds(car):
    bind(car, "2", "spinning_forward", "UpArrow")
    bind(car, "2", "spinning_forward", "Alpha1")
    assert car.blocks["2"].bindings["spinning_forward"] == ("Alpha1",)
    bind(car, "2", "spinning_forward", "Keypad5", "add_control_key")
    bind(car, "2", "spinning_forward", "Keypad5", "add_control_key")
    assert car.blocks["2"].bindings["spinning_forward"] == ("Alpha1", "Keypad5")


@pytest.mark.parametrize("count", [0, 1, 7, 100])
def test_a_call_takes_several_presses(car, count):
    bind(car, "2", "spinning_forward", "UpArrow")
    more = [{"time": 2.0 * k, "key": "UpArrow", "hold_for": 1} for k in range(1, count + 1)]
    one = {"time": 0, "key": "UpArrow", "hold_for": 1}
    outcome = car.act("add_control_sequence", {**one, "more": more})
    assert outcome.ok
    assert [p.time_s for p in car.control_sequence] == [2.0 * k for k in range(count + 1)]
    assert len(outcome.text.splitlines()) == count + 2


@pytest.mark.parametrize(
    ("bad", "cause"),
    [
        ({"time": -1, "key": "UpArrow", "hold_for": 1}, Cause.OUT_OF_RANGE),
        ({"time": 1, "key": "UpArrow", "hold_for": 0}, Cause.OUT_OF_RANGE),
        ({"time": 1, "key": "DownArrow", "hold_for": 1}, Cause.BAD_KEY),
        ({"time": 1, "key": "UpArrow"}, Cause.MALFORMED_ARGUMENTS),
        ({"time": "1", "key": "UpArrow", "hold_for": 1}, Cause.MALFORMED_ARGUMENTS),
        ({"time": 1, "key": 5, "hold_for": 1}, Cause.MALFORMED_ARGUMENTS),
        ([1, "UpArrow", 1], Cause.MALFORMED_ARGUMENTS),
        (None, Cause.MALFORMED_ARGUMENTS),
    ],
)
def test_one_bad_press_refuses_the_whole_call(car, bad, cause):
    bind(car, "2", "spinning_forward", "UpArrow")
    one = {"time": 0, "key": "UpArrow", "hold_for": 1}
    outcome = car.act("add_control_sequence", {**one, "more": [{**one, "time": 2}, bad]})
    assert outcome.cause is cause
    assert car.control_sequence == ()


def test_a_sequence_takes_keys_that_do_something_in_the_order_of_entry(car):
    assert press(car, 0, "UpArrow", 1).reason == RefusalClass.BAD_KEY
    bind(car, "2", "spinning_forward", "UpArrow")
    assert press(car, 5, "UpArrow", 1.5).ok
    assert press(car, 0, "UpArrow", 6).ok, "presses may overlap"
    kept = [(one.time_s, one.key, one.hold_for_s) for one in car.control_sequence]
    assert kept == [(5, "UpArrow", 1.5), (0, "UpArrow", 6)]


def test_entries_are_removed_by_the_number_the_review_shows(car):
    bind(car, "2", "spinning_forward", "UpArrow")
    for time in range(3):
        press(car, time, "UpArrow", 1)
    assert "1: at 1 s hold UpArrow for 1 s" in car.act("review_control_sequence").text
    assert car.act("remove_control_sequence", {"index": 1}).ok
    assert [entry.time_s for entry in car.control_sequence] == [0, 2]
    for index in (-1, 2, 99):
        outcome = car.act("remove_control_sequence", {"index": index})
        assert outcome.reason == RefusalClass.BAD_INDEX
    assert car.act("reset_control_sequence").ok
    assert car.control_sequence == ()
    assert car.blocks["2"].bindings["spinning_forward"] == ("UpArrow",)


TOOLS = {tool.name: tool for tool in tool_definitions()}
JUNK = [
    *(None, True, False, 0, 1, -1, 2, 3.0, 0.5, -0.25, -0.0),
    *(1e300, -1e300, 10**40, -(10**400), 2**63, math.nan, math.inf, -math.inf),
    *("", " ", "1", "2", "99", "A", "E", "a", "é", "\U0001d504", "\x00", "\ud800"),
    *("x" * 501, "x" * 5000, "null", "NaN", "[0, 0, 0]", "UpArrow", "W", "hold_to_fire"),
    *("Space", "F1", "spinning_forward", "spinning_backward"),
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
        logged = [[record.reason for record in one.log.records] for one in (again, machine)]
        assert logged[0] == logged[1]
    names = ("MALFORMED_ARGUMENTS", "UNKNOWN_ACTION", "OUT_OF_RANGE", "BAD_KEY")
    names += ("BLOCK_PRESENCE", "UNKNOWN_SUB_STRUCTURE")
    assert reasons >= {RefusalClass[name] for name in names}


def test_junk_in_one_argument_is_accepted_or_refused_with_a_sentence(build, subtests):
    for value in JUNK:
        for name, argument, others in [
            ("attach_block_to", "face", {"base_block": "1", "new_block": "Torch"}),
            ("twist_block", "angle", {"block_id": "2"}),
            ("shift_block", "shift_real", {"block_id": "2"}),
            ("remove_control_sequence", "index", {}),
        ]:
            with subtests.test(value=value, name=name):
                machine = build(("1", "A", "Powered Wheel"))
                before = machine.copy()
                outcome = machine.act(name, {**others, argument: value})
                if not outcome.ok:
                    assert outcome.text.endswith(".")
                    assert machine == before


def test_what_is_no_json_is_kept_in_the_log_as_unreadable(build):
    machine = build()
    machine.act("twist_block", {"block_id": "1", "angle": math.nan, "note": object()})
    unread = {"angle": {"unreadable": "nan"}, "note": {"unreadable": "object"}}
    assert machine.log.records[-1].arguments == {"block_id": "1", **unread}


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
    assert machine.log.records[-1].arguments == {"program": program}
    again = replay(machine.log)
    assert again.controller == program
    assert again.to_document() == machine.to_document()
    refused = machine.act("set_controller", {"program": program * 3})
    assert not refused.ok
    assert machine.log.records[-1].arguments == {
        "program": {"unreadable": f"text of {3 * len(program)} characters"}
    }
    assert replay(machine.log).to_document() == machine.to_document()
