"""Timelines of channels: read as keys, written of keys and of programs that do not look."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from support.machines.trials import press
from tests.besiege.playing import vehicle
from typer.testing import CliRunner

from buildarena_besiege import MachineNotPlayableError, machine_with_timeline, timeline_of
from buildarena_besiege.timeline import SCHEMA
from buildarena_cli.main import app
from buildarena_geometry import Machine
from buildarena_geometry.errors import DocumentError
from buildarena_simulation import ControllerFailed


def event(time: float, block: int, channel: str, value: float) -> dict[str, object]:
    return {"time": time, "block": block, "channel": channel, "value": value}


def timeline(*events: dict[str, object], **changes: object) -> bytes:
    return json.dumps({"schema": SCHEMA, "events": list(events), **changes}).encode()


def timed(*events: dict[str, object]) -> Machine:
    return machine_with_timeline(vehicle(cannon=True), timeline(*events), where="t").machine


def written(machine: Machine, seconds: float = 4.0) -> list[dict[str, object]]:
    content = json.loads(timeline_of(machine, seconds=seconds))
    assert content["schema"] == SCHEMA
    return content["events"]


def numbers(machine: Machine) -> dict[str, int]:
    return {block: number for number, block in enumerate(machine.blocks, 1)}


def wheels(machine: Machine) -> list[str]:
    return [block.id for block in machine.blocks.values() if block.module.motor]


def test_what_is_read_is_written_again() -> None:
    machine = vehicle(cannon=True)
    first, second = (numbers(machine)[wheel] for wheel in wheels(machine)[:2])
    events = [
        event(0.5, first, "ForwardKey", 1.0),
        event(0.5, second, "ForwardKey", 1.0),
        event(1.25, first, "BackwardKey", 1.0),
        event(1.5, first, "BackwardKey", 0.0),
        event(2.0, first, "ForwardKey", 0.0),
        event(2.0, second, "ForwardKey", 0.0),
    ]
    assert sorted(written(timed(*events)), key=str) == sorted(events, key=str)


def test_channels_that_are_on_together_share_a_key_and_nothing_else_acts() -> None:
    machine = vehicle(cannon=True)
    ids = wheels(machine)
    own = [numbers(machine)[wheel] for wheel in ids]
    program = machine.with_controller("function control() end")
    events = [event(0.0, n, "ForwardKey", v) for n in own for v in (1.0,)]
    after = machine_with_timeline(program, timeline(*events), where="t").machine
    assert after.controller == ""
    (hold,) = after.control_sequence
    assert (hold.time_s, hold.hold_for_s) == (0.0, 600.0)
    for block in after.blocks.values():
        bound = {action: keys for action, keys in block.bindings.items() if keys}
        assert bound == ({"spinning_forward": (hold.key,)} if block.id in ids else {})


def test_values_between_are_on_above_a_half_and_are_counted() -> None:
    machine = vehicle()
    number = numbers(machine)[wheels(machine)[0]]
    events = [event(t, number, "ForwardKey", v) for t, v in ((1, 0.4), (2, 0.6), (3, 0.5))]
    result = machine_with_timeline(machine, timeline(*events), where="t")
    assert result.shares == 3
    (hold,) = result.machine.control_sequence
    assert (hold.time_s, hold.hold_for_s) == (2.0, 1.0)


def test_of_two_events_at_one_time_the_later_in_the_list_counts() -> None:
    machine = vehicle()
    number = numbers(machine)[wheels(machine)[0]]
    events = [event(2, number, "ForwardKey", 0), event(1, number, "ForwardKey", 0)]
    assert not timed(*events, event(1, number, "ForwardKey", 0)).control_sequence
    assert timed(*events, event(1, number, "ForwardKey", 1)).control_sequence


NONSENSE = {
    "not JSON": (b"{", "not valid JSON"),
    "no UTF-8": (b"\xff\xfe\x00", "not valid JSON"),
    "deep": (b"[" * 5000, "inside each other"),
    "a list": (b"[]", "expected an object"),
    "another schema": (timeline(schema="buildarena.control_timeline.v1"), f"one of {SCHEMA}"),
    "no events": (json.dumps({"schema": SCHEMA}).encode(), "events is missing"),
    "an unknown field": (timeline(speed=2), "no field 'speed'; the fields are schema, events"),
    "no time": (timeline({"block": 2, "channel": "ForwardKey", "value": 1}), "time is missing"),
    "an earlier time": (timeline(event(-1, 2, "ForwardKey", 1)), "at least 0"),
    "no number": (b'{"schema": "%s", "events": [{"time": NaN, "block": 2, "channel": "ForwardKey",'
                  b' "value": 1}]}' % SCHEMA.encode(), "events[0].time"),
    "too large": (timeline(event(0, 2, "ForwardKey", 1.5)), "at most 1"),
    "below 0": (timeline(event(0, 2, "ForwardKey", -1)), "at least 0"),
    "half a block": (timeline(event(0, 2.5, "ForwardKey", 1)), "a whole number"),
    "a text": (timeline(event("soon", 2, "ForwardKey", 1)), "expected a number"),
    "no block 0": (timeline(event(0, 0, "ForwardKey", 1)), "there is no block 0; the machine's"),
    "no block": (timeline(event(0, 99, "ForwardKey", 1)), "events[0].block: there is no block 99"),
    "no channel": (timeline(event(0, 1, "ForwardKey", 1)), "no channel 'ForwardKey'; It has none"),
    "a near channel": (timeline(event(0, 2, "ForwadKey", 1)),
                       "did you mean ForwardKey or BackwardKey? It has ForwardKey, BackwardKey"),
    "too many": (timeline(*[event(0, 2, "ForwardKey", 1)] * 20_001), "at most 20,000"),
}  # fmt: skip


@pytest.mark.parametrize(("data", "words"), NONSENSE.values(), ids=NONSENSE)
def test_nonsense_is_refused_with_its_place_and_what_is_valid(data, words) -> None:
    with pytest.raises(DocumentError) as caught:
        machine_with_timeline(vehicle(), data, where="t")
    assert words in str(caught.value)
    assert len(str(caught.value)) < 400


def test_more_times_than_there_are_keys_are_refused() -> None:
    machine = vehicle()
    block = machine.blocks[wheels(machine)[0]]
    blocks = dict(machine.state.blocks)
    for n in range(100, 113):
        blocks[str(n)] = replace(block, id=str(n))
    many = machine.restored(replace(machine.logged, state=replace(machine.state, blocks=blocks)))
    events = [
        event(n / 10 + apart, n, channel, 1)
        for n, part in enumerate(many.blocks.values(), 1)
        if part.module.motor
        for channel, apart in (("ForwardKey", 0), ("BackwardKey", 0.05))
    ]
    with pytest.raises(DocumentError, match="there are 24 keys"):
        machine_with_timeline(many, timeline(*events), where="t")


def test_holds_of_one_key_that_touch_are_one() -> None:
    machine = vehicle()
    keyed = timed(event(0, numbers(machine)[wheels(machine)[0]], "ForwardKey", 1))
    key = keyed.control_sequence[0].key
    presses = (press(key, 2.0, 1.0), press(key, 1.0, 1.5))
    state = replace(keyed.state, control_sequence=presses)
    keyed = keyed.restored(replace(keyed.logged, state=state))
    assert [(each["time"], each["value"]) for each in written(keyed)] == [(1.0, 1.0), (3.0, 0.0)]


OPEN = """
function control(t, sense)
  if t < 1 then return { spinning_forward = 0.25 } end
  if t < 2 then return { ["%s.spinning_backward"] = 1 } end
end
"""


def test_a_program_that_does_not_look_is_written_with_its_shares() -> None:
    machine = vehicle()
    first, *others = wheels(machine)
    events = written(machine.with_controller(OPEN % first))
    of = numbers(machine)
    for wheel in others:
        assert [e for e in events if e["block"] == of[wheel]] == [
            event(0.0, of[wheel], "ForwardKey", 0.25),
            event(1.0, of[wheel], "ForwardKey", 0.0),
        ]
    assert [e for e in events if e["channel"] == "BackwardKey"] == [
        event(1.0, of[first], "BackwardKey", 1.0),
        event(2.0, of[first], "BackwardKey", 0.0),
    ]


LOOKS = [
    "local x = sense.position",
    "if sense.position then end",
    "for _ in pairs(sense) do end",
    "local _ = next(sense)",
    "local n = #sense",
    "sense.mine = 1",
    "if t > 2 then local x = sense['a' .. 'b'] end",
    "local function f(s) return s.cargo end f(sense)",
]


@pytest.mark.parametrize("body", LOOKS)
def test_a_program_that_looks_is_no_timeline(body) -> None:
    program = f"function control(t, sense)\n{body}\nend"
    with pytest.raises(MachineNotPlayableError, match="reads a sense at"):
        timeline_of(vehicle().with_controller(program), seconds=4.0)


def test_a_program_that_fails_by_itself_says_so() -> None:
    with pytest.raises(ControllerFailed, match="line 1, tick 0"):
        timeline_of(vehicle().with_controller("function control() error('no') end"), seconds=1.0)


def test_nothing_that_acts_is_no_timeline() -> None:
    with pytest.raises(MachineNotPlayableError, match="no key presses"):
        timeline_of(timed(), seconds=1.0)


def run(*words: object):
    return CliRunner().invoke(app, [str(word) for word in words])


def test_the_commands_are_each_others_opposite(tmp_path: Path) -> None:
    machine, source, out, back = (tmp_path / f"{n}.json" for n in ("m", "t", "o", "b"))
    machine.write_text(json.dumps(vehicle().to_document()), encoding="utf-8")
    events = [event(0.5, 2, "ForwardKey", 1.0), event(2.5, 2, "ForwardKey", 0.0)]
    source.write_bytes(timeline(*events))
    done = run("machine", "control", "import", source, "--machine", machine, "--out", out)
    assert (done.exit_code, done.stdout.strip()) == (0, str(out)), done.output
    assert run("machine", "control", "export", out, "--out", back).exit_code == 0
    assert json.loads(back.read_text())["events"] == events
    source.write_bytes(timeline(event(0.5, 2, "ForwardKey", 0.7)))
    done = run("machine", "control", "import", source, "--machine", machine, "--out", out)
    assert "1 events have a value between 0 and 1" in done.stderr


def test_the_commands_refuse_with_a_sentence(tmp_path: Path) -> None:
    machine, source, program = (tmp_path / n for n in ("m.json", "t.json", "p.lua"))
    machine.write_text(json.dumps(vehicle().to_document()), encoding="utf-8")
    source.write_bytes(timeline(event(0.5, 2, "Forward", 1.0)))
    out = tmp_path / "o.json"
    done = run("machine", "control", "import", source, "--machine", machine, "--out", out)
    assert (done.exit_code, "did you mean ForwardKey" in done.stderr) == (1, True)
    program.write_text("function control(t, s) return s.up end", encoding="utf-8")
    done = run("machine", "control", "export", machine, "--controller", program, "--out", out)
    assert (done.exit_code, "line 1 of the program reads a sense" in done.stderr) == (1, True)
    assert not out.exists()
