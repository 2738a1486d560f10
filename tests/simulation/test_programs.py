"""Programs of controllers: what they may use, what they may cost, and how they fail."""

import pickle
import random
import re
import string
import time
from pathlib import Path

import numpy as np
import pytest
from support.marks import nightly

from buildarena_simulation import ControllerFailed
from buildarena_simulation.controllers import program as bounds
from buildarena_simulation.controllers.program import Program

LAYOUT = {"height": 0, "position": {"x": 1, "y": 2}}


def ready(text: str, *, seed: int = 0) -> Program:
    program = Program(text, seed=seed)
    program.senses_are(LAYOUT)
    return program


def answered(text: str, *, ticks: int = 1, seed: int = 0) -> list[dict[str, float]]:
    program = ready(text, seed=seed)
    return [program.answer(tick, 0.04 * tick, [5.0, 1.0, 2.0]) for tick in range(ticks)]


def control(body: str) -> str:
    return f"function control(t, sense)\n{body}\nend"


def test_a_program_is_told_what_it_senses_and_keeps_its_variables() -> None:
    text = "local n = 0\n" + control(
        """n = n + 1
        local aside = sense.position.y - sense.position.x
        return { up = sense.height, aside = aside, n = n, t = t }"""
    )
    first, second = answered(text, ticks=2)
    assert first == {"up": 5.0, "aside": 1.0, "n": 1.0, "t": 0.0}
    assert second == {"up": 5.0, "aside": 1.0, "n": 2.0, "t": 0.04}


LEFT_OUT = """
collectgarbage coroutine debug dofile getmetatable io load loadstring os package pcall print python
rawequal rawget rawlen rawset require setmetatable string utf8 warn xpcall
"""


def test_nothing_and_yes_and_no_are_answers() -> None:
    assert answered(control("")) == [{}]
    assert answered(control("return { a = true, b = false }")) == [{"a": 1.0, "b": 0.0}]


def test_what_was_sensed_before_stays_what_it_was() -> None:
    program = ready(
        "local last\n"
        + control("local was = last last = sense return was and { h = was.height } or {}")
    )
    assert program.answer(0, 0.0, [5.0, 0.0, 0.0]) == {}
    assert program.answer(1, 0.04, [6.0, 0.0, 0.0]) == {"h": 5.0}


def test_a_program_has_nothing_of_files_processes_or_other_programs() -> None:
    for there in ("{}", "_G.{}"):
        asked = ", ".join(f"{name} = {there.format(name)} ~= nil" for name in LEFT_OUT.split())
        (answer,) = answered(control(f"return {{ {asked} }}"))
        assert answer == dict.fromkeys(LEFT_OUT.split(), 0.0)


def test_tables_are_gone_through_in_the_order_of_their_keys() -> None:
    text = control(
        """
        local t, seen = { 10, 20 }, {}
        for _, name in ipairs({ "b", "zz", "a", "c" }) do t[name] = 1 end
        t[true] = 1
        for key in pairs(t) do seen[#seen + 1] = tostring(key) end
        local first = next(t)
        return { [table.concat(seen, " ") .. " " .. tostring(first)] = 1 }
        """
    )
    assert answered(text) == [{"1 2 a b c zz true 1": 1.0}]


def test_nothing_that_is_written_depends_on_the_process() -> None:
    text = control(
        "return { [tostring({}) .. tostring(control) .. tostring(1.5)] = math.random() }"
    )
    names = {name for _ in range(3) for name in answered(text)[0]}
    assert names == {"tablefunction1.5"}


def test_random_numbers_come_from_the_seed() -> None:
    text = control("return { a = math.random(), b = math.random(6), c = math.random(3, 4) }")
    again = [answered(text, ticks=50, seed=seed) for seed in (1, 1, 2)]
    assert again[0] == again[1] != again[2]
    assert all(
        0 <= each["a"] < 1 and each["b"] in range(1, 7) and each["c"] in {3, 4} for each in again[0]
    )
    assert {each["b"] for each in again[0]} == set(range(1, 7))


FAILING = [
    ("local x = sense.nothing.y", "attempt to index field 'nothing' (a nil value)", 2),
    ("\n\nerror('no way up')", "no way up", 4),
    ("error({ secret = 1 })", "it threw a table", None),
    ("local n = 'ab' for i = 1, 20 do n = n .. n end error(n)", "ababab", 2),
    ("return 5", "it answers a number in place of a table", None),
    ("return { 5 }", "a name that it answers is a number", None),
    ("return { a = 'x' }", "what it answers for a is a string", None),
    ("local n = 'a' for i = 1, 9 do n = n .. n end return { [n] = 1 }", "than 100 bytes", None),
    ("return { a = 0/0 }", "what it answers for a is no number", None),
    ("for k in pairs({ [{}] = 1 }) do end", "a table with a table as a key has no order", 2),
    ("local s = ('x'):rep(9)", "attempt to index constant 'x' (a string value)", 2),
    ("return { a = 'x' + 1 }", "attempt to perform arithmetic on a string value", 2),
    ("local x = table.concat({}, '', 1, 1e9)", "table.concat joins 1000 texts at most", 2),
    ("local x = table.unpack({}, 1, 1e9)", "table.unpack gives 250 values at most", 2),
    ("local t = {} for i = 1, 600 do t['n' .. i] = 1 end return t", "than 500 names", None),
]


def test_a_program_that_fails_names_tick_and_line() -> None:
    for body, words, line in FAILING:
        program = ready(control(body))
        with pytest.raises(ControllerFailed, match=re.escape(words)) as caught:
            program.answer(7, 0.28, [5.0, 1.0, 2.0])
        assert "tick 7 (0.28 s)" in caught.value.reason
        assert (caught.value.line, caught.value.tick) == (line, 7), body
        assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)


UNREADABLE = [
    ("function control( end", "line 1: <name> or"),
    ("return 1", "no function control(t, sense)"),
    ("x = nil + 1\nfunction control() end", "line 1: attempt to perform arithmetic"),
    ("--" + "x" * 70_000, "has 70,002 bytes; at most 65,536"),
    ("\x1bLua\x53", "attempt to load a binary chunk"),
    ("sensors = 5\nfunction control() end", "sensors is no list of block ids"),
    ("sensors = { {} }\nfunction control() end", "sensors is no list of block ids"),
    ("sensors = {} for i = 1, 200 do sensors[i] = i end function control() end", "than 100"),
    ("(" * 300, "too many C levels"),
    ("\ud800", "the controller failed, line 1"),
]


def test_a_program_that_cannot_be_read_says_why() -> None:
    for text, words in UNREADABLE:
        with pytest.raises(ControllerFailed, match=re.escape(words)):
            Program(text)


NEWER = [
    ("local x = 5 // 2", "//: write math.floor(a / b)"),
    *(
        (f"local x = 5 {sign} 2", "write * and / by powers of two")
        for sign in ("&", "|", "~", "<<", ">>")
    ),
    ("local x = ~2", "write * and / by powers of two"),
    ("local x <const> = 5", "<const> and <close>: write the name alone"),
    ("local x < close > = nil", "<const> and <close>: write the name alone"),
    ("local x = '\\u{41}'", "\\u: write the bytes"),
]


def test_what_the_games_lua_does_not_have_is_refused_with_what_to_write() -> None:
    for newer, instead in NEWER:
        with pytest.raises(ControllerFailed, match=re.escape(instead)) as caught:
            Program(control(newer))
        assert caught.value.line == 2
        assert "programs are Lua 5.2, which has no" in caught.value.reason
    for wrong in ("x = 5 /", "x = = 2", "x = 5 // = 2", "local x <const = 2"):
        with pytest.raises(ControllerFailed) as caught:
            Program(control(wrong))
        assert "write" not in caught.value.reason, "no Lua has it"


NUMBERS = [
    ("6 / 2", "3"),
    ("2 ^ 53", "9.007199254741e+15"),
    ("7 % 0", "-nan"),
    ("7 % -3", "-2"),
    ("math.fmod(7, -3)", "1"),
    ("math.modf(-2.5)", "-2"),
    ("select(2, math.modf(-2.5))", "-0.5"),
    ("math.atan(-1, -1)", "-2.3561944901923"),
    ("math.tointeger or math.type or math.ult or math.maxinteger", "nil"),
]


def test_numbers_are_doubles_and_no_more() -> None:
    for number, text in NUMBERS:
        ((name, _),) = answered(control(f"return {{ [tostring(({number}))] = 1 }}"))[0].items()
        assert name.lstrip("-") == text.lstrip("-") if "nan" in text else name == text


HERE = Path(__file__).parents[1] / "data/control/endless.lua"
PARTS = [part.partition("\n") for part in HERE.read_text().split("\n--- ")[1:]]
ENDLESS = {name: body for name, _, body in PARTS}
ENDED = re.compile("more than|overflow|too many|at most")


def test_no_program_goes_on_for_ever() -> None:
    as_it_is_read = "{body}\nfunction control() end"
    at_a_tick = "function control()\n{body}\nend"
    for name, body in ENDLESS.items():
        began = time.process_time()
        assert ENDED.search(_reason(at_a_tick.format(body=body))), name
        assert time.process_time() - began < 10 * bounds.MAX_TICK_S, name
    doubled = "local s = 'x' for i = 1, 24 do s = s .. s end"
    assert "8 MiB of memory" in _reason(at_a_tick.format(body=doubled)), "16 MiB, and it ends"
    for name in ("a loop", "recursion", "a long text again and again"):
        assert ENDED.search(_reason(as_it_is_read.format(body=ENDLESS[name]))), name


def _reason(program: str) -> str:
    try:
        answered(program, ticks=5)
    except ControllerFailed as failure:
        return failure.reason
    return "it came to an end"


def first_failure(program: Program) -> ControllerFailed:
    """With what a program ends that is asked again and again."""
    for tick in range(100_000):
        try:
            program.answer(tick, 0.0, [1.0, 1.0, 1.0])
        except ControllerFailed as failure:
            return failure
    raise AssertionError("it never ends")


def test_a_trial_has_so_many_instructions_in_all() -> None:
    program = ready(control("for i = 1, 20000 do local x = i * i end"))
    failure = first_failure(program)
    assert "20,000,000 instructions in all" in failure.reason
    assert 200 < failure.tick < 500


def test_instructions_are_counted_alike_in_every_run() -> None:
    body = "local t = {} for i = 1, 900 do t['k' .. i] = i end for k in pairs(t) do end"
    failed = [first_failure(ready(control(body))).tick for _ in range(2)]
    assert failed[0] == failed[1]


def test_a_program_cannot_spoil_what_counts_it() -> None:
    text = """
    local all = _G
    for name in pairs(all) do all[name] = nil end
    math, table, pairs, next, error, type = nil, nil, nil, nil, nil, nil
    function control(t, sense) sense.height = {} while true do end end
    """
    with pytest.raises(ControllerFailed, match="100,000 instructions"):
        answered(text)


def test_programs_do_not_know_each_other() -> None:
    one, other = (
        ready("x = 1\n" + control("x = x + 1 return { x = x }")),
        ready("x = 5\n" + control("return { x = x }")),
    )
    assert one.answer(0, 0.0, [0.0] * 3) == {"x": 2.0}
    assert other.answer(0, 0.0, [0.0] * 3) == {"x": 5.0}


SAMPLE = """
local gains, sum = { p = 0.5, i = 0.1 }, 0
local function clipped(x, low, high) return math.max(low, math.min(high, x)) end
function control(t, sense)
  local missing = 10 - sense.height
  sum = clipped(sum + missing * 0.04, -5, 5)
  local answer = { fly = clipped(gains.p * missing + gains.i * sum, 0, 1) }
  for key, value in pairs(sense.position) do
    if value > 3 and t > 1 then answer["steer_" .. key] = -value / 10 end
  end
  return answer
end
"""


HOSTILE = ["while true do end", "1e308*10", "0/0", "nil", "{}", "..", "#", "[[", "goto x"]


def mutated(draw: random.Random) -> str:
    """The sample with a few changes, as of a typist, a copier, or a stranger who means ill."""
    text = SAMPLE
    for _ in range(draw.randint(1, 4)):
        place, other = sorted(draw.randrange(len(text) + 1) for _ in range(2))
        before, between, after = text[:place], text[place:other], text[other:]
        text = draw.choice(
            [
                before + draw.choice(string.printable + "\x00\xff\u2028") + between + after,
                before + (between + after)[draw.randint(1, 9) :],
                before + 2 * between + after,
                before + draw.choice(re.findall(r"\w+", text) or ["x"]) + between + after,
                before + draw.choice(HOSTILE) + after,
            ]
        )
    return text


@pytest.mark.parametrize("count", [400, nightly(10_000)])
def test_a_mutated_program_answers_or_fails_by_its_own_fault(count) -> None:
    draw, failures = random.Random(3), []
    for _ in range(count):
        try:
            answers = answered(mutated(draw), ticks=3)
        except ControllerFailed as failure:
            failures.append(failure.reason)
            continue
        assert not np.isnan([value for answer in answers for value in answer.values()]).any()
    assert 0.2 * count < len(failures) < count
    assert all(reason.isprintable() and len(reason) < 400 for reason in failures)
