"""Keys and control sequences."""

import pytest

from buildarena_geometry import KEYS, Cause, KeyPress, RefusalClass


@pytest.fixture
def car(build):
    return build(
        ("1", "A", "Powered Wheel"),
        ("1", "B", "Powered Wheel"),
        ("1", "E", "Water Cannon"),
        ("1", "F", "Torch"),
    )


def bind(machine, block, action, key, name="change_control_key"):
    return machine.act(name, {"block_id": block, "action": action, "new_key": key})


def press(machine, time, key, hold_for):
    arguments = {"time": time, "key": key, "hold_for": hold_for}
    return machine.act("add_control_sequence", arguments)


def test_there_are_twenty_four_keys():
    assert len(KEYS) == len(set(KEYS)) == 24


def test_a_binding_belongs_to_one_block_and_one_action(car):
    assert bind(car, "2", "spinning_forward", "UpArrow").ok
    assert car.blocks["2"].bindings == {"spinning_forward": ("UpArrow",), "spinning_backward": ()}
    assert car.blocks["3"].bindings == {"spinning_forward": (), "spinning_backward": ()}


def test_changing_a_key_replaces_and_adding_one_adds(car):
    bind(car, "2", "spinning_forward", "UpArrow")
    bind(car, "2", "spinning_forward", "Alpha1")
    assert car.blocks["2"].bindings["spinning_forward"] == ("Alpha1",)
    bind(car, "2", "spinning_forward", "Keypad5", "add_control_key")
    bind(car, "2", "spinning_forward", "Keypad5", "add_control_key")
    assert car.blocks["2"].bindings["spinning_forward"] == ("Alpha1", "Keypad5")


@pytest.mark.parametrize("key", ["W", "uparrow", "Alpha10", "F1", ""])
def test_other_keys_do_not_exist(car, key):
    outcome = bind(car, "2", "spinning_forward", key)
    assert outcome.reason == RefusalClass.BAD_KEY
    assert "UpArrow" in outcome.text


@pytest.mark.parametrize(
    ("block", "action", "cause"),
    [
        ("2", "hold_to_fire", Cause.BAD_ACTION),
        ("4", "spinning_forward", Cause.BAD_ACTION),
        ("5", "burn", Cause.NO_LOCOMOTION),
        ("1", "move", Cause.NO_LOCOMOTION),
        ("9", "move", Cause.NO_SUCH_BLOCK),
    ],
)
def test_only_actions_a_block_has_can_be_bound(car, block, action, cause):
    assert bind(car, block, action, "UpArrow").cause is cause


def test_an_answer_has_the_new_line_and_the_count_and_no_other_line(car):
    bind(car, "2", "spinning_forward", "UpArrow")
    first = press(car, 0, "UpArrow", 1).text.splitlines()
    assert first == ["Added. The sequence has 1 entry.", "0: at 0 s hold UpArrow for 1 s"]
    for count in range(2, 6):
        answer = press(car, count, "UpArrow", 0.5).text.splitlines()
        assert answer == [
            f"Added. The sequence has {count} entries.",
            f"{count - 1}: at {count} s hold UpArrow for 0.5 s",
        ]


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
    assert car.control_sequence == (
        KeyPress(time_s=5, key="UpArrow", hold_for_s=1.5),
        KeyPress(time_s=0, key="UpArrow", hold_for_s=6),
    )


@pytest.mark.parametrize(("time", "hold_for"), [(-0.1, 1), (0, 0), (0, -1), (1e7, 1)])
def test_times_lie_in_the_future_and_presses_last(car, time, hold_for):
    bind(car, "2", "spinning_forward", "UpArrow")
    assert press(car, time, "UpArrow", hold_for).reason == RefusalClass.OUT_OF_RANGE


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


def test_reviews_list_what_is_powered_and_bound(car):
    bind(car, "4", "hold_to_fire", "Alpha0")
    config = car.act("review_control_config").text
    assert "4 Water Cannon: hold_to_fire Alpha0" in config
    assert "Torch" not in config
    powered = car.act("review_powered_blocks").text
    assert powered.count("Powered Wheel") == 2
    assert "points" in powered
