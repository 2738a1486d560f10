"""The stand-in game in its window, played by mouse, keyboard and clipboard."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from PIL import Image, ImageChops
from stand_in_machines import machine_file, reporting
from stand_in_play import SIZE, Game, Table, start_game
from virtual_screen import missing_packages

from buildarena_geometry import Machine

pytestmark = pytest.mark.skipif(missing_packages() != "", reason=missing_packages())


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    machine = Machine()
    machine.act("start", {})
    script = reporting(["1"], keys={"UpArrow": (0.5, 999)})
    (tmp_path / "post.bsg").write_text(machine_file(machine, script=script))
    (tmp_path / "Tall_2.bsg").write_text(machine_file(machine))
    (tmp_path / "broken.bsg").write_text("<Machine")
    return tmp_path


@pytest.fixture
def game(table: Table, folder: Path) -> Iterator[Game]:
    with table.game(folder) as game:
        yield game


def test_one_run_from_the_load_panel_to_the_empty_floor(game: Game) -> None:
    game.load("post")
    game.click("set ground")
    game.until("ground", lambda r: r["grounded"])
    game.press("ctrl", "l")
    game.until("Lua panel", lambda r: r["lua_panel"])
    game.start()
    game.until("some lines", lambda r: r["time_s"] > 2)
    assert game.report()["keys_held"] == ["uparrow"]
    lines = game.copy_log()
    updates = [int(line.split(",")[0]) for line in lines]
    assert updates == sorted(updates, reverse=True)
    assert updates[-1] == 4
    assert float(lines[-1].split(", ")[3]) == pytest.approx(0.49, abs=0.03)  # on the floor
    game.click("start")
    stopped = game.until("a stop", lambda r: r["phase"] == "build")
    assert stopped["machine"] == "post"
    assert stopped["keys_held"] == []
    game.click("empty space")
    game.press("ctrl", "l")
    game.until("no Lua panel", lambda r: not r["lua_panel"])
    game.click("delete")
    game.until("the question", lambda r: r["phase"] == "confirm")
    game.click("confirm")
    ended = game.until("an empty floor", lambda r: r["machine"] is None)
    assert ended["phase"] == "build"
    assert ended["modifiers"] == []
    assert ended["counts"] == {"loads": 1, "starts": 1, "stops": 1, "deletes": 1, "copies": 1}


def test_without_set_ground_the_machine_falls_from_where_the_file_puts_it(game: Game) -> None:
    game.load("post")
    game.press("ctrl", "l")
    game.start()
    game.until("the fall", lambda r: r["time_s"] > 1.5)
    heights = [float(line.split(", ")[3]) for line in game.copy_log()]
    assert heights[-1] == pytest.approx(5.0, abs=0.05)
    assert heights[0] == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize(
    ("name", "complaint"),
    [("POST", 'no machine "POST"'), ("tall_2", 'no machine "tall_2"'), ("broken", "not XML")],
)
def test_what_cannot_be_loaded_leaves_the_panel_open(game: Game, name: str, complaint: str) -> None:
    game.click("open folder")
    game.click("name box")
    game.press("ctrl", "a")
    game.type(name)
    game.click("open machine")
    report = game.until("a message", lambda r: r["message"] != "")
    assert complaint in report["message"]
    assert report["phase"] == "load panel"
    assert report["machine"] is None


def test_the_name_box_keeps_capitals_and_what_was_typed(game: Game, table: Table) -> None:
    game.load("Tall_2")
    game.click("open folder")
    game.click("name box")
    game.press("end")
    game.type("x")
    game.press("ctrl", "a")
    game.press("ctrl", "c")
    game.until("a copy", lambda r: r["counts"]["copies"] == 1)
    assert table.hands.do("copied") == "Tall_2x"
    game.put_on_clipboard("po st")
    game.press("ctrl", "v")
    game.press("backspace")
    game.until("a paste", lambda r: r["name_box"] == "po s")
    game.press("escape")
    closed = game.until("no panel", lambda r: r["phase"] == "build")
    assert closed["machine"] == "Tall_2"


def test_keys_go_where_the_focus_is(game: Game) -> None:
    game.load("post")
    game.press("ctrl", "l")
    game.press("space")
    game.until("simulation", lambda r: r["phase"] == "simulating")
    game.click("log window")
    game.until("focus", lambda r: r["focus"] == "log")
    game.press("space")
    game.click("empty space")
    game.until("no focus", lambda r: r["focus"] is None)
    assert game.report()["phase"] == "simulating"
    game.press("space")
    game.until("a stop", lambda r: r["phase"] == "build")
    game.click("open folder")
    game.click("name box")
    game.press("space")
    report = game.until("a blank", lambda r: r["name_box"].endswith(" "))
    assert report["phase"] == "load panel"
    assert report["counts"]["starts"] == 1


def test_while_it_runs_nothing_can_be_built(game: Game) -> None:
    game.load("post")
    game.start()
    for spot in ("delete", "set ground", "open folder"):
        game.click(spot)
    game.click("start")
    report = game.until("a stop", lambda r: r["counts"]["stops"] == 1)
    assert report["phase"] == "build"
    assert not report["grounded"]
    assert report["counts"]["loads"] == 1


def test_the_question_keeps_everything_else_away_until_it_is_answered(game: Game) -> None:
    game.load("post")
    game.click("delete")
    game.until("the question", lambda r: r["phase"] == "confirm")
    for spot in ("start", "open folder", "empty space"):
        game.click(spot)
    game.press("space")
    game.press("escape")
    report = game.until("no question", lambda r: r["phase"] == "build")
    assert report["machine"] == "post"
    assert report["counts"]["starts"] == 0


def test_nothing_is_copied_without_focus_or_selection(game: Game, table: Table) -> None:
    game.put_on_clipboard("what was there")
    game.load("post")
    game.press("ctrl", "l")
    game.start()
    game.press("ctrl", "a")
    game.press("ctrl", "c")
    game.click("log window")
    game.press("ctrl", "c")
    game.press("ctrl", "a")
    game.click("empty space")
    game.press("ctrl", "c")
    game.until("no focus", lambda r: r["focus"] is None)
    assert game.report()["counts"]["copies"] == 0
    assert table.hands.do("copied") == "what was there"


def test_the_log_keeps_a_limited_number_of_lines(table: Table, folder: Path) -> None:
    with table.game(folder, "--log-lines", "7") as game:
        game.load("post")
        game.press("ctrl", "l")
        game.start()
        game.until("many lines", lambda r: r["time_s"] > 2)
        updates = [int(line.split(",")[0]) for line in game.copy_log()]
    assert len(updates) == 7
    assert updates == list(range(updates[0], updates[0] - 28, -4))


def test_held_modifiers_are_told(game: Game, table: Table) -> None:
    game.click("empty space")
    for key in ("ctrl", "shift"):
        table.hands.do("down", key)
    game.until("both", lambda r: r["modifiers"] == ["Control", "Shift"])
    for key in ("ctrl", "shift"):
        table.hands.do("up", key)
    game.until("none", lambda r: r["modifiers"] == [])


def test_loading_and_running_change_the_picture(game: Game, table: Table, folder: Path) -> None:
    def picture(name: str) -> Image.Image:
        path = folder / f"{name}.png"
        table.hands.do("grab", str(path))
        image = Image.open(path).convert("RGB")
        return image.crop((60, 40 + SIZE[1] // 10, 60 + SIZE[0], 40 + SIZE[1]))

    empty = picture("empty")
    game.load("post")
    loaded = picture("loaded")
    game.start()
    game.until("the fall", lambda r: r["time_s"] > 1.5)
    fallen = picture("fallen")
    assert ImageChops.difference(empty, loaded).getbbox() is not None
    assert ImageChops.difference(loaded, fallen).getbbox() is not None


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (["--speed", "0"], "a number above 0"),
        (["--size", "1280"], "two numbers"),
        (["--machines", "/nowhere"], "there is no folder"),
        (["--spede", "3"], "unknown options: --spede"),
    ],
)
def test_bad_options_are_named(table: Table, options: list[str], complaint: str) -> None:
    process = start_game(*options, environment=table.environment)
    try:
        told, _ = process.communicate(timeout=30)
    except subprocess.TimeoutExpired:
        process.kill()
        raise
    assert process.returncode == 2
    assert complaint in told
