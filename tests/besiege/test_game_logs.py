"""A log counts whole lines of its run only, whatever the window or the stream made of them."""

import random
import time

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.besiege.playing import RUN, played, vehicle

from buildarena_besiege import GameLog, LogIncompleteError, run_ids, trajectory_of
from buildarena_besiege.checksums import checksum
from buildarena_simulation import Scenario

SCENARIO = Scenario(duration_s=2.0)
MACHINE = vehicle()
LINES = tuple(played(MACHINE, SCENARIO, updates=260).lines)
WHOLE = "\n".join(reversed(LINES))


def log_of(*texts: str, run_id: str = RUN) -> GameLog:
    log = GameLog(run_id)
    for text in texts:
        log.read(text)
    return log


REFERENCE = log_of(WHOLE)


def signed(body: str) -> str:
    return f"{body},{checksum(body)}"


def test_a_log_knows_its_begin_its_end_and_its_time() -> None:
    log = GameLog(RUN)
    assert (log.begun, log.ended, log.time_s, log.complaints) == (False, False, 0.0, ())
    log.read(LINES[0])
    assert (log.begun, log.ended, log.time_s) == (True, False, 0.0)
    log.read("\n".join(LINES[:12]))
    assert log.time_s == pytest.approx(0.4)
    log.read(WHOLE)
    assert (log.begun, log.ended, log.time_s) == (True, True, 2.5)


VARIANTS = {
    "in order": "\n".join(LINES),
    "newest first": WHOLE,
    "twice": f"{WHOLE}\n{WHOLE}",
    "windows line ends": WHOLE.replace("\n", "\r\n"),
    "old line ends": WHOLE.replace("\n", "\r"),
    "a byte order mark": f"\ufeff{WHOLE}\n",
    "blanks around": "\n".join(f"  {line}\t\xa0" for line in LINES),
    "glued together": "".join(LINES),
    "zeros between": "\x00\n\x00".join(LINES),
    "empty lines": "\n\n\n".join(LINES),
    "non-ASCII between": "\nÄ 日本 😀\n".join(LINES),
}


def test_form_does_not_matter(subtests) -> None:
    for name, text in VARIANTS.items():
        with subtests.test(name=name):
            assert log_of(text) == REFERENCE


def test_order_repeats_and_pieces_do_not_matter() -> None:
    drawn = random.Random(1)
    for _ in range(20):
        copies = [list(LINES[i : i + 30]) for i in range(0, len(LINES), 10)]
        drawn.shuffle(copies)
        texts = []
        for copy in copies:
            text = "\n".join(reversed(copy))
            # The window's edges cut lines off.
            texts.append(text[drawn.randrange(20) :] if drawn.random() < 0.5 else text[:-7])
        log = log_of(*texts, WHOLE[: len(WHOLE) // 2], WHOLE[len(WHOLE) // 2 - 400 :])
        assert log == REFERENCE
        assert log.complaints == ()


@given(st.lists(st.integers(1, 400), max_size=40), st.booleans())
@settings(max_examples=40, deadline=None)
def test_a_stream_may_be_cut_anywhere(sizes, windows) -> None:
    text = "\r\n".join(LINES) if windows else "\n".join(LINES)
    log = GameLog(RUN)
    at = 0
    for size in sizes:
        log.read(text[at : at + size])
        at += size
    log.read(text[at:])
    assert log == REFERENCE


@given(st.data())
@settings(max_examples=150, deadline=None)
def test_no_damaged_line_counts(data) -> None:
    line = data.draw(st.sampled_from(LINES))
    cut = data.draw(st.integers(0, len(line) - 1))
    other = data.draw(st.text(st.characters(codec="ascii"), max_size=3))
    damaged = line[:cut] + other + line[cut + data.draw(st.integers(0, 3)) :]
    if damaged.strip() == line or LINES.count(damaged):
        return
    found = {one.text for one in log_of(damaged).lines}
    assert found <= {line}
    if line not in damaged:
        assert not found


def test_other_runs_in_the_window_do_not_matter() -> None:
    names = ("run-10", "run-", "un-1", "run-1,s", "RUN-1")
    runs = [played(MACHINE, SCENARIO, updates=210, run_id=name) for name in names]
    others = [line for run in runs for line in run.lines]
    mixed = [line for pair in zip(LINES, others, strict=False) for line in pair]
    log = log_of("\n".join([*mixed, *LINES, *others]))
    assert log == REFERENCE
    assert log.complaints == ()
    assert set(run_ids("\n".join(mixed))) >= {"run-1", "run-10"}


COMPLAINTS = [
    "main.lua:12: attempt to index a nil value (field 'x')",
    '[string "main.lua"]:3: bad argument #1, number expected, got nil',
    "LuaRoot/main.lua:1: unexpected symbol near '<', in function",
    "stack traceback:",
    "attempt to call a nil value",
    "Error: script stopped",
]


def test_errors_are_complaints_and_nothing_else_is(subtests) -> None:
    for complaint in COMPLAINTS:
        with subtests.test(complaint=complaint):
            for text in (complaint, f"{complaint}\n{WHOLE}", f"{WHOLE}\r\n{complaint}\r\n"):
                assert log_of(text).complaints == (complaint,)
            assert log_of(f"{LINES[5][:40]}{complaint}\n").complaints
            other = log_of("0.1, ID_1, 1.0, 2.0, 3.0\nhello, terror\nba,other,s,lua,1")
            assert other.complaints == ()


def test_a_complaint_in_the_last_row_of_a_copy_is_not_lost() -> None:
    log = log_of(f"{WHOLE}\n{COMPLAINTS[0]}", WHOLE)
    assert any(COMPLAINTS[0] in one for one in log.complaints)
    assert log == REFERENCE


def test_complaints_are_bounded() -> None:
    log = log_of("\n".join(f"lua error {i} {'x' * 10_000}" for i in range(500)))
    assert len(log.complaints) == 50
    assert max(map(len, log.complaints)) <= 500


def test_what_is_kept_makes_an_equal_log() -> None:
    log = log_of("junk\n" + WHOLE + "\nlua error")
    again = log_of(log.text())
    assert again == log
    assert again.text() == log.text()
    kept = log.text().splitlines()
    assert kept[0] == LINES[0]
    assert len(kept) == len(set(LINES))
    assert log != log_of(WHOLE, run_id="run-2")


def test_of_lines_that_contradict_each_other_none_is_believed() -> None:
    line = LINES[20]
    fields = line.rpartition(",")[0].split(",")
    fields[-1] = "7.0000"
    other = signed(",".join(fields))
    log = log_of(WHOLE, other)
    assert other in log.text()
    assert log_of(log.text()) == log
    with pytest.raises(LogIncompleteError, match=r"two conflicting lines for t = 0\."):
        trajectory_of(log, MACHINE, SCENARIO, game="1", mod="2")


FORGED = [
    "ba,run-1,s,4,0,1",
    "ba,run-1,s,4,2,1",
    "ba,run-1,s,04,1,1,1,-,0.0000,0.0000,0.0000",
    "ba,run-1,s,4,1,1,1,-,0.000,0.0000,0.0000",
    "ba,run-1,s,4,1,1,1,-,1e5,0.0000,0.0000",
    "ba,run-1,s,4,1,1,1,2,0.0000,0.0000,0.0000",
    "ba,run-1,s,4,1,1,1,-,0.0000,0.0000",
    "ba,run-1,s,99999999999,1,1",
    "ba,run-1,x,4",
    "ba,run-1",
    "ba,run-1,",
    "ba,run-1,e,४",
]


def test_lines_of_another_form_do_not_count_even_with_their_sum(subtests) -> None:
    for body in FORGED:
        with subtests.test(body=body):
            assert not log_of(signed(body)).lines


def test_megabytes_are_read_in_moments(subtests) -> None:
    for text in [
        "x" * 5_000_000,
        "ba,run-1," * 150_000,
        "ba,run-1,s,4,1,1," + "1,-,0.0000,0.0000,0.0000," * 100_000,
        "\n" * 3_000_000,
        (LINES[3] + "\n") * 20_000,
        "lua" * 1_000_000,
    ]:
        with subtests.test(text=text):
            started = time.process_time()
            log_of(text, text[: len(text) // 2])
            assert time.process_time() - started < 10
