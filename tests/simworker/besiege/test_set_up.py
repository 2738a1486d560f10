"""Calibration, examination and refusals of a machine that is not set up."""

import json
import os
import subprocess
import sys
import time
from dataclasses import asdict, replace
from typing import Self

import pytest
from support.game.game_rig import Rig
from support.game.steam_library import library

from buildarena_simworker.besiege.errors import NotSetUpError
from buildarena_simworker.besiege.log_sources import LogFile
from buildarena_simworker.besiege.process import GameProcess
from buildarena_simworker.besiege.screen.calibration import POSITIONS, Calibration, load_calibration
from buildarena_simworker.besiege.settings import BesiegeSettings
from buildarena_simworker.besiege.traces import Traces

pytestmark = pytest.mark.ci

PROGRAM = [sys.executable, "-m", "buildarena_simworker.besiege"]


def answer(words: list[str], rig: Rig, screen: dict[str, str] | None, **given: object):
    environment = {**os.environ, **rig.environment(), **(screen or {})}
    if "DISPLAY" not in (screen or {}):
        environment.pop("DISPLAY", None)
    return subprocess.run(
        [*PROGRAM, *words],
        env=environment,
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
        **given,
    )


def test_the_published_positions_are_tried_with_a_small_machine(rig, screen) -> None:
    done = answer(["calibrate", "--defaults"], rig, screen)
    assert done.returncode == 0, (done.stdout, done.stderr)
    assert "Loaded, started, read" in done.stdout
    assert not list(rig.machines.iterdir())


@pytest.mark.nightly
def test_wrong_positions_are_found_out_and_named(rig, screen) -> None:
    places = {**Calibration().positions, "open_machine": (0.9, 0.9)}
    Calibration(positions=places).save(rig.folder / "state" / "calibration.json")
    done = answer(["calibrate", "--try"], replace(rig, patience=0.2), screen)
    assert done.returncode == 1
    assert "It does not work yet: " in done.stdout
    assert "load the machine batry: the list of machines stayed open" in done.stdout


@pytest.mark.nightly
def test_a_person_points_at_each_place(rig, screen) -> None:
    with GamePlayed(rig, screen) as person:
        done = person.calibrate()
    assert done == 0, person.told
    found = load_calibration(rig.folder / "state" / "calibration.json")
    assert found.window == (1280, 800)
    assert found.pixels["log_window"] == pytest.approx((640, 400), abs=2)
    assert "A machine runs and prints" in person.told
    assert found.positions["start"] == pytest.approx((0.5, 0.5), abs=0.01)
    kept = {name: place for name, (place, _) in POSITIONS.items() if name != "start"}
    assert {name: found.positions[name] for name in kept} == kept


class GamePlayed:
    """A game, and a person who calibrates: points at the start button only, keeps the rest."""

    def __init__(self, rig: Rig, screen: dict[str, str]) -> None:
        self._environment = {**os.environ, **rig.environment(), **screen}
        self._rig = rig
        self.told = ""

    def __enter__(self) -> Self:
        words = self._environment["BUILDARENA_BESIEGE_COMMAND"].replace("{level}", "").split()
        self._game = subprocess.Popen(words, env=self._environment)
        ends = time.monotonic() + 20
        while not (self._rig.folder / "report.json").exists():
            assert time.monotonic() < ends
            time.sleep(0.1)
        return self

    def __exit__(self, *_: object) -> None:
        self._game.kill()
        self._game.wait()

    def calibrate(self) -> int:
        self._point_at_the_middle()
        answers = "".join("\n" if name == "start" else "k\n" for name in POSITIONS) + "\n"
        # Positions are only asked for here: that they work is another test's.
        program = (
            "from buildarena_simworker.besiege import calibrate as c;"
            "c.try_out = lambda *_: True; c.learnt = lambda before, *_: before;"
            "import sys; sys.argv = ['x', 'calibrate'];"
            "import buildarena_simworker.besiege.__main__"
        )
        done = subprocess.run(
            [sys.executable, "-c", program],
            env=self._environment,
            input=answers,
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
        )
        self.told = done.stdout + done.stderr
        return done.returncode

    def _point_at_the_middle(self) -> None:
        program = (
            "from buildarena_simworker.besiege.screen.input import ScreenInput;"
            "from buildarena_simworker.besiege.screen.windows import open_windows;"
            "from buildarena_simworker.besiege.screen.window_types import Wanted;"
            "h = ScreenInput(); a = open_windows(Wanted(title='besiege')).find();"
            "h.move(a.left + a.width // 2, a.top + a.height // 2)"
        )
        subprocess.run(
            [sys.executable, "-c", program], env=self._environment, check=True, timeout=30
        )


def test_a_machine_that_can_play_is_found_able(rig, screen) -> None:
    done = answer(["doctor", "--json"], rig, screen)
    found = {one["name"]: one for one in json.loads(done.stdout)}
    assert all(one["ok"] for one in found.values()), found
    assert {"versions", "folder of machine files", "display", "calibration", "window"} <= set(found)


def test_without_a_screen_the_doctor_says_so_and_goes_on(rig) -> None:
    done = answer(["doctor"], rig, None)
    assert done.returncode == 1
    assert "!!  display: there is no screen" in done.stdout
    assert "ok  versions" in done.stdout


def test_a_worker_without_a_screen_does_not_start_and_says_why(rig) -> None:
    environment = {**os.environ, **rig.environment()}
    environment.pop("DISPLAY", None)
    done = subprocess.run(
        [sys.executable, "-m", "buildarena_simworker", "--simulator", "besiege"],
        env=environment,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 1
    assert "there is no screen to play on" in done.stderr


def test_without_the_extra_the_doctor_says_what_to_install(rig, tmp_path) -> None:
    (tmp_path / "pyautogui.py").write_text("raise ImportError('No module named pyautogui')")
    path = f"{tmp_path}{os.pathsep}{rig.environment()['PYTHONPATH']}"
    done = answer(["doctor"], rig, {"PYTHONPATH": path})
    assert "pip install buildarena[besiege]" in done.stdout


def test_what_is_missing_is_named_with_advice(rig, subtests) -> None:
    for changes, named in [
        ({"MACHINES": "/nowhere"}, "folder of machine files"),
        ({"GAME": ""}, "versions"),
        ({"COMMAND": "/nowhere/besiege"}, "restart"),
    ]:
        with subtests.test(changes=changes):
            found = findings(
                rig, {f"BUILDARENA_BESIEGE_{name}": to for name, to in changes.items()}
            )
            assert not found[named]["ok"]
            assert "BUILDARENA_BESIEGE_" in found[named]["advice"]


def test_the_doctor_names_versions_that_differ(rig, tmp_path) -> None:
    kept = {"build": "1", "mod_file_version": "1.4"}
    rig.calibrate(installed=kept)
    folder = str(library(tmp_path, version="1.2.0"))
    found = findings(rig, {"BUILDARENA_BESIEGE_FOLDER": folder})
    assert found["Lua Scripting Mod"]["advice"] == "BUILDARENA_BESIEGE_MOD is 1.4: set it to 1.2.0"
    assert "2383785201" in found["Lua Scripting Mod"]["detail"]
    assert found["build of the game"]["detail"] == "25346, as Steam has it"
    assert not found["unchanged"]["ok"]
    assert "the game's build was 1 " in found["unchanged"]["detail"]
    (tmp_path / "empty").mkdir()
    found = findings(rig, {"BUILDARENA_BESIEGE_FOLDER": str(tmp_path / "empty")})
    assert not found["Lua Scripting Mod"]["ok"]


def findings(rig: Rig, changes: dict[str, str]):
    """What the doctor finds without a screen, by name."""
    done = answer(["doctor", "--json"], rig, changes)
    return {one["name"]: one for one in json.loads(done.stdout)}


def test_a_calibration_comes_back_as_it_was(tmp_path) -> None:
    file = tmp_path / "deep" / "calibration.json"
    made = Calibration(window=(1280, 800))
    made.save(file)
    assert load_calibration(file) == made
    assert load_calibration(file).digest == made.digest
    assert Calibration().digest != made.digest


def spoiled(**changes: object) -> dict[str, object]:
    """What a calibration's file holds, with something changed."""
    made = {"version": 2, **asdict(Calibration())}
    return {**made, **changes}


def test_a_spoiled_calibration_is_refused_with_what_to_do(tmp_path, subtests) -> None:
    for content in [
        "",
        "[]",
        "{}",
        '{"version": 1}',
        '{"version": 2, "positions": {"start": [0.1, 0.1]}}',
        json.dumps({"version": 2, "positions": {name: [0.5, 0.5] for name in POSITIONS}}),
        json.dumps(spoiled(positions={**Calibration().positions, "more": [0.5, 0.5]})),
        json.dumps(spoiled(positions={name: [0.5, 1.5] for name in POSITIONS})),
        json.dumps(spoiled(positions={name: ["a", 0] for name in POSITIONS})),
        json.dumps(spoiled(positions={name: [0.5] for name in POSITIONS})),
        json.dumps(spoiled(pixels={"log_window": [1, 1], "lua_panel": [1, -1]})),
        json.dumps(spoiled(pixels={"log_window": [1, 1], "lua_panel": [0.5, 0.5]})),
    ]:
        with subtests.test(content=content):
            file = tmp_path / "calibration.json"
            file.write_text(content)
            with pytest.raises(NotSetUpError, match="buildarena besiege calibrate"):
                load_calibration(file)


def test_a_log_file_is_read_by_whole_lines_and_begun_anew(tmp_path) -> None:
    file = tmp_path / "log.txt"
    log = LogFile(file)
    assert log.read() == ""
    file.write_bytes(b"one\ntw")
    assert log.read() == "one\n"
    with file.open("ab") as more:
        more.write("o\nd\u00e9".encode()[:-1])
    assert log.read() == "two\n"
    file.write_bytes(b"new\n")
    assert log.read() == "new\n"
    log.skip()
    assert log.read() == ""


def test_traces_name_only_machine_files(tmp_path) -> None:
    precious = tmp_path / "precious.txt"
    precious.write_text("keep")
    traces = Traces(tmp_path / "state")
    (tmp_path / "state").mkdir()
    (tmp_path / "state" / "run.json").write_text(json.dumps({"file": str(precious)}))
    assert traces.left
    traces.remove()
    assert precious.exists()
    traces.put(tmp_path / "a.bsg", b"<Machine/>")
    assert traces.left
    traces.remove()
    assert not (tmp_path / "a.bsg").exists()
    assert not traces.left


def test_a_process_that_took_a_dead_games_number_is_left_alone(tmp_path) -> None:
    other = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
    settings = BesiegeSettings(state=tmp_path, command="true")
    (tmp_path / "game.json").write_text(json.dumps({"pid": other.pid, "created": 1.0, "level": ""}))
    process = GameProcess(settings)
    assert not process.is_running()
    process.kill()
    assert other.poll() is None
    other.kill()
    other.wait()
