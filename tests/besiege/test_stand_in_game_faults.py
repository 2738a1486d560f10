"""The stand-in game's faults: each does what it says, as often as it is told."""

from __future__ import annotations

import json
import time
from collections import Counter
from pathlib import Path

import pytest
from stand_in_game.faults import KINDS, POINTS, Fault, FaultError, random_faults, read_faults
from stand_in_game.log_window import LogWindow
from stand_in_machines import machine_file, reporting
from stand_in_play import Game, Table
from virtual_screen import missing_packages

from buildarena_geometry import Machine

on_screen = pytest.mark.skipif(missing_packages() != "", reason=missing_packages())


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    machine = Machine()
    machine.act("start", {})
    text = machine_file(machine, script=reporting(["1"]))
    (tmp_path / "post.bsg").write_text(text)
    return tmp_path


def read(tmp_path: Path, entries: object) -> list[Fault]:
    path = tmp_path / "faults.json"
    path.write_text(json.dumps(entries))
    return read_faults(path)


def run_for(game: Game, seconds: float) -> list[str]:
    """The log after so much game time."""
    game.load("post")
    game.press("ctrl", "l")
    game.until("Lua panel", lambda r: r["lua_panel"])
    game.start()
    game.until("some time", lambda r: r["time_s"] > seconds)
    return game.copy_log()


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ({"fault": "crash"}, "a list of objects"),
        (["crash"], "an object with"),
        ([{"fault": "explosion"}], "no fault 'explosion'; choices: slow_load"),
        ([{"fault": "freeze", "second": 3}], "no 'second'; choices: fault, at, times, seconds"),
        ([{"fault": "freeze", "at": "lunch"}], "no point 'lunch'; choices: open_folder"),
        ([{"fault": "cut_lines", "at": "copy"}], "strikes at 'start' only"),
        ([{"fault": "crash", "times": -1}], "times is a whole number or null"),
    ],
)
def test_unknown_faults_are_named_with_the_choices(
    tmp_path: Path, entries: object, message: str
) -> None:
    with pytest.raises(FaultError, match=message):
        read(tmp_path, entries)


def test_every_fault_has_a_point_of_its_own(tmp_path: Path) -> None:
    faults = read(tmp_path, [{"fault": kind} for kind in KINDS])
    assert [fault.at for fault in faults] == [point for point, _ in KINDS.values()]
    assert {fault.at for fault in faults} <= set(POINTS)


def test_random_faults_are_the_same_for_a_seed_and_never_end_a_game() -> None:
    drawn = [random_faults(seed) for seed in range(200)]
    assert drawn == [random_faults(seed) for seed in range(200)]
    kinds = Counter(fault.kind for faults in drawn for fault in faults)
    assert set(kinds) == set(KINDS) - {"freeze", "crash"}
    assert all(fault.at in POINTS for faults in drawn for fault in faults)


@pytest.mark.parametrize(
    ("fault", "shown"),
    [
        (Fault(kind="cut_lines", at="start", options={"column": 3}), ["bcd", "abc"]),
        (Fault(kind="lost_lines", at="start", options={"share": 1}), []),
        (
            Fault(kind="repeat_lines", at="start", options={"share": 1}),
            ["bcdef", "bcdef", "abcde", "abcde"],
        ),
    ],
)
def test_faults_of_lines(fault: Fault, shown: list[str]) -> None:
    log = LogWindow(9, seed=0)
    log.append(["abcde", "bcdef"], [fault])
    assert log.text() == "\n".join(shown)


def test_some_lines_are_lost_and_some_repeated_by_their_shares() -> None:
    log = LogWindow(4000, seed=1)
    lines = [str(number) for number in range(1000)]
    log.append(lines, [Fault(kind="lost_lines", at="start")])
    assert 600 < len(log) < 800
    log.clear()
    log.append(lines, [Fault(kind="repeat_lines", at="start")])
    assert 1200 < len(log) < 1400


@on_screen
def test_a_slow_load_takes_its_time_once(table: Table, folder: Path) -> None:
    with table.game(folder, faults=[{"fault": "slow_load", "seconds": 0.8}]) as game:
        took = []
        for _ in range(2):
            began = time.monotonic()
            game.load("post")
            took.append(time.monotonic() - began)
            game.click("delete")
            game.click("confirm")
            game.until("an empty floor", lambda r: r["machine"] is None)
    assert took[0] > 0.8
    assert took[1] < took[0] - 0.4


@on_screen
@pytest.mark.parametrize("way", ["dialog's OK", "escape"])
def test_a_dialog_swallows_clicks_until_it_is_closed(table: Table, folder: Path, way: str) -> None:
    with table.game(folder, faults=[{"fault": "dialog", "text": "Survey"}]) as game:
        game.click("open folder")
        game.until("a dialog", lambda r: r["dialog"] == "Survey")
        game.click("open folder")
        game.click("empty space")
        assert game.report()["phase"] == "build"
        if way == "escape":
            game.press("escape")
        else:
            game.click(way)
        game.until("no dialog", lambda r: r["dialog"] == "")
        game.load("post")
        assert game.report()["faults"] == ["dialog at open_folder"]


@on_screen
def test_another_window_takes_the_keyboard_until_the_game_is_clicked(
    table: Table, folder: Path
) -> None:
    with table.game(folder, faults=[{"fault": "lost_focus", "at": "name_box"}]) as game:
        game.click("open folder")
        game.click("name box")
        game.until("the fault", lambda r: r["faults"] != [])
        time.sleep(0.2)
        before = game.report()["name_box"]
        game.type("lost")
        game.click("name box")
        game.press("ctrl", "a")
        game.type("found")
        report = game.until("typing again", lambda r: r["name_box"] == "found")
    assert before == "my machine"
    assert report["phase"] == "load panel"


@on_screen
def test_a_window_in_front_keeps_the_mouse_away_until_it_goes(table: Table, folder: Path) -> None:
    fault = {"fault": "lost_focus", "at": "set_ground", "covers": True, "seconds": 1.5}
    with table.game(folder, faults=[fault]) as game:
        game.load("post")
        game.click("set ground")
        game.until("the fault", lambda r: r["faults"] != [])
        time.sleep(0.3)
        game.click("delete")
        time.sleep(1.5)
        assert game.report()["phase"] == "build"
        game.click("delete")
        game.until("the question", lambda r: r["phase"] == "confirm")


@on_screen
def test_a_freeze_ends_after_its_seconds(table: Table, folder: Path) -> None:
    fault = {"fault": "freeze", "at": "open_folder", "seconds": 0.8}
    with table.game(folder, faults=[fault]) as game:
        began = time.monotonic()
        game.click("open folder")
        game.until("the panel", lambda r: r["phase"] == "load panel")
        assert time.monotonic() - began >= 0.8


@on_screen
def test_a_freeze_without_seconds_lasts(table: Table, folder: Path) -> None:
    with table.game(folder, faults=[{"fault": "freeze", "after_s": 0.5}]) as game:
        game.load("post")
        game.start()
        time.sleep(0.5)
        stuck = game.report()["time_s"]
        game.click("start")
        time.sleep(0.5)
        assert game.report()["time_s"] == stuck
        assert game.report()["phase"] == "simulating"
        assert game.process.poll() is None


@on_screen
@pytest.mark.parametrize("point", ["simulating", "open_machine"])
def test_a_crash_ends_the_process(table: Table, folder: Path, point: str) -> None:
    with table.game(folder, faults=[{"fault": "crash", "at": point}]) as game:
        game.click("open folder")
        game.until("the panel", lambda r: r["phase"] == "load panel")
        game.click("name box")
        game.press("ctrl", "a")
        game.type("post")
        game.click("open machine")
        if point == "simulating":
            game.until("machine", lambda r: r["machine"] == "post" and r["rollout_ready"])
            game.click("start")
        assert game.process.wait(timeout=20) == 139


@on_screen
def test_caps_lock_turns_letters_round_until_it_is_pressed_again(
    table: Table, folder: Path
) -> None:
    with table.game(folder, faults=[{"fault": "caps_lock"}]) as game:
        game.click("open folder")
        game.until("the fault", lambda r: r["faults"] != [])
        game.click("name box")
        game.press("ctrl", "a")
        game.type("post")
        report = game.until("letters", lambda r: r["name_box"].lower() == "post")
        assert report["name_box"] == "POST"
        assert report["caps_lock"]
        game.press("capslock")
        game.press("ctrl", "a")
        game.type("post")
        game.until("small letters", lambda r: r["name_box"] == "post" and not r["caps_lock"])


@on_screen
def test_the_clipboard_is_stolen_after_a_copy(table: Table, folder: Path) -> None:
    fault = {"fault": "clipboard_stolen", "text": "shopping list", "times": 1}
    with table.game(folder, faults=[fault]) as game:
        run_for(game, 1.0)
        end = time.monotonic() + 10
        while table.hands.do("copied") != "shopping list":
            assert time.monotonic() < end
        assert len(game.copy_log()) > 20


@on_screen
def test_a_lua_error_ends_the_script_and_not_the_game(table: Table, folder: Path) -> None:
    fault = {"fault": "lua_error", "update": 42, "text": "main.lua:3: out of luck"}
    with table.game(folder, faults=[fault]) as game:
        lines = run_for(game, 2.0)
        assert lines[0] == "Lua error: main.lua:3: out of luck"
        assert lines[1].startswith("40, 1, ")
        assert len(lines) == 11
        game.click("start")
        game.start()
        game.until("some time", lambda r: r["time_s"] > 1)
        assert not any("Lua" in line for line in game.copy_log())


@on_screen
def test_a_lagging_game_is_slower_than_the_wall_clock_and_irregular(
    table: Table, folder: Path
) -> None:
    fault = {"fault": "lag", "slowness": 8}
    with table.game(folder, "--speed", "10", faults=[fault]) as game:
        game.load("post")
        game.start()
        time.sleep(1.0)
        game.until("some time", lambda r: r["time_s"] > 0.2)
        assert game.report()["time_s"] < 5.0


@on_screen
def test_a_scrolled_log_is_copied_without_its_newest_lines(table: Table, folder: Path) -> None:
    with table.game(folder, faults=[{"fault": "log_scrolled", "lines": 30}]) as game:
        first = run_for(game, 2.0)
        second = game.copy_log()
    newest, oldest = (int(first[place].split(",")[0]) for place in (0, -1))
    assert int(second[0].split(",")[0]) - newest >= 120
    # The window drops old lines by itself, should the game have run on for long.
    assert oldest <= int(second[-1].split(",")[0])
