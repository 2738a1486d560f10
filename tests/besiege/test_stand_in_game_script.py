"""Machines' scripts in the stand-in game: the mod's functions as its public source has them."""

from __future__ import annotations

import pytest
from stand_in_game.script import Script, ScriptError, euler_angles
from stand_in_game.trial import Part

CALLS = """
local info, seen
local function play() info = machine.get_machine_info() end
local function fixed_update() {body} end
return {{play = play, fixed_update = fixed_update}}
"""


class Bench:
    """A world of three blocks that writes down what is done to it."""

    def __init__(self) -> None:
        self.name, self.done, self.lines = "bench", [], []

    def places(self, ref_key: str) -> tuple[int, ...]:
        return {"Wheel_1": (1, 2), "Ballast_9": (0,)}.get(ref_key, ())

    def block_count(self) -> int:
        return 3

    def block(self, place: int) -> Part:
        return Part(
            type_id=15,
            position=(0.5 + place, 1.25, -2.0),
            right=(1.0, 0.0, 0.0),
            up=(0.0, 1.0, 0.0),
            forward=(0.0, 0.0, 1.0),
            burning=place == 2,
        )

    def press(self, key: str, down: bool) -> None:
        self.done.append((key, down))

    def slide(self, place: int, slider: str, value: float) -> None:
        self.done.append((place, slider, value))

    def run(self, body: str) -> list[str]:
        script = Script(CALLS.format(body=body), self, self.lines.append)
        script.call("play")
        script.call("fixed_update")
        script.call("late_update")
        return self.lines


def test_blocks_tell_where_they_are() -> None:
    lines = Bench().run("""
        local p = info.get_block_info(0).position()
        print(string.format("%.2f, %.2f, %.2f", p.x, p.y, p.z))
        local first, second = info.get_block_info("Wheel_1"), info.get_block_info("Wheel_1", 1)
        print(first.position().x, second.position().x)
        print(second.burning(), first.burning(), info.block_count())
        print(info.name(), first.forward().z, first.rotation().y)
    """)
    assert lines == ["0.50, 1.25, -2.00", "1.5\t2.5", "true\tfalse\t3", "bench\t1\t0"]


def test_keys_are_pressed_once_however_often_it_is_told() -> None:
    bench = Bench()
    bench.run("""
        local key = machine.new_key_emulator("UpArrow")
        key.start() key.start() print(key.active()) key:stop() key.stop()
        machine.new_key_emulator("Alpha1").start()
    """)
    assert bench.done == [("uparrow", True), ("uparrow", False), ("alpha1", True)]
    assert bench.lines == ["true"]


def test_a_slider_is_set_on_every_block_of_the_reference() -> None:
    bench = Bench()
    bench.run('machine.get_refs_control("Wheel_1").set_slider("mass", 7.5)')
    assert bench.done == [(1, "mass", 7.5), (2, "mass", 7.5)]


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("local x = nil; print(x.y)", "main.lua:4: attempt to index local 'x'"),
        ("error('enough')", "enough"),
        ("machine.get_refs_control('Wheel_2')", "no block with key: Wheel_2"),
        ("info.get_block_info('Wheel_2')", "no block with reference key Wheel_2"),
        ("info.get_block_info(3)", "build index 3 out of bounds"),
        ("info.get_block_info('Wheel_1', 2)", "no block with index 2"),
        ("machine.new_key_emulator('Up')", "not present"),
        ("machine.new_key_emulator('a') machine.new_key_emulator('A')", "already a key emulator"),
        ("local c = machine.get_refs_control('Wheel_1') c:set_slider('mass', 3)", "with a dot"),
        ("machine.get_refs_control('Wheel_1').set_slider('mass', 'x')", "number expected"),
        ("info:get_block_info(0).position()", "attempt to index a nil value"),
        ("os.exit(3)", "attempt to index global 'os'"),
        ("print(python.eval('1'))", "attempt to index global 'python'"),
    ],
)
def test_errors_say_where_and_what(body: str, message: str) -> None:
    with pytest.raises(ScriptError, match=message):
        Bench().run(body)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("return 3 // 2", "unexpected symbol"),  # the mod's Lua is 5.2
        ("return {play = ", "unexpected symbol"),
        ("local x = 1", "no table of functions"),
        ("error('at once')", "at once"),
    ],
)
def test_scripts_that_cannot_be_loaded(text: str, message: str) -> None:
    with pytest.raises(ScriptError, match=message):
        Script(text, Bench(), print)


def test_angles_are_unitys() -> None:
    turned = Part(
        type_id=0,
        position=(0.0, 0.0, 0.0),
        right=(0.0, 0.0, -1.0),
        up=(0.0, 1.0, 0.0),
        forward=(1.0, 0.0, 0.0),
    )
    assert euler_angles(turned) == pytest.approx((0.0, 90.0, 0.0))
