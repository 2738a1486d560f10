"""Calibration, examination and refusals of a machine that is not set up."""

import json
import os
import subprocess
import sys
import time
from dataclasses import asdict

import pytest
from support.game.game_rig import Rig, library
from support.programs import captured

from buildarena_simworker.besiege.errors import NotSetUpError
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
    return captured([*PROGRAM, *words], env=environment, within_s=100, **given)


@pytest.mark.nightly
def test_a_person_points_at_each_place(rig, screen) -> None:
    """The person points at the start button only and keeps the rest; that it works is not tried."""
    environment = {**os.environ, **rig.environment(), **screen}
    game = subprocess.Popen(rig.game().split(), env=environment)
    ends = time.monotonic() + 20
    while not (rig.folder / "report.json").exists():
        assert time.monotonic() < ends
        time.sleep(0.1)
    program = (
        "from buildarena_simworker.besiege.screen.input import ScreenInput;"
        "from buildarena_simworker.besiege.screen.window import open_windows;"
        "from buildarena_simworker.besiege.settings import BesiegeSettings;"
        "a = open_windows(BesiegeSettings(title='besiege', executable='')).find();"
        "ScreenInput().move(a.left + a.width // 2, a.top + a.height // 2);"
        "from buildarena_simworker.besiege import calibrate as c;"
        "c.try_out = lambda *_: True; c.record_findings = lambda before, *_: before;"
        "import sys; sys.argv = ['x', 'calibrate'];"
        "import buildarena_simworker.besiege.__main__"
    )
    given = "".join("\n" if name == "start" else "k\n" for name in POSITIONS) + "\n"
    words = [sys.executable, "-c", program]
    done = captured(words, env=environment, input=given, within_s=60)
    game.kill()
    game.wait()
    assert done.returncode == 0, done.stderr
    assert "A machine runs and prints" in done.stdout
    found = load_calibration(rig.folder / "state" / "calibration.json")
    assert found.window == (1280, 800)
    assert found.positions["start"] == pytest.approx((0.5, 0.5), abs=0.01)
    kept = {name: place for name, (place, _) in POSITIONS.items() if name != "start"}
    assert {name: found.positions[name] for name in kept} == kept


def test_the_published_positions_are_tried_with_a_small_machine(rig, screen) -> None:
    done = answer(["calibrate", "--defaults"], rig, screen)
    assert done.returncode == 0, (done.stdout, done.stderr)
    assert "Loaded, started, read" in done.stdout
    assert not list(rig.machines.iterdir())


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
    words = [sys.executable, "-m", "buildarena_simworker", "--simulator", "besiege"]
    done = captured(words, env=environment, within_s=60)
    assert done.returncode == 1
    assert "there is no screen to play on" in done.stderr


def test_what_is_missing_is_named_with_advice(rig, subtests) -> None:
    for changes, named in [
        ({"MACHINES": "/nowhere"}, "folder of machine files"),
        ({"GAME": ""}, "versions"),
        ({"COMMAND": "/nowhere/besiege"}, "restart"),
    ]:
        with subtests.test(changes=changes):
            found = findings(rig, {f"BUILDARENA_BESIEGE_{key}": to for key, to in changes.items()})
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


def spoiled(**changes: object) -> dict[str, object]:
    """What a calibration's file holds, with something changed."""
    made = {"version": 2, **asdict(Calibration())}
    return {**made, **changes}


def test_a_spoiled_calibration_is_refused_with_what_to_do(tmp_path, subtests) -> None:
    for content in [
        "",
        "[]",
        '{"version": 1}',
        json.dumps({"version": 2, "positions": {name: [0.5, 0.5] for name in POSITIONS}}),
        json.dumps(spoiled(positions={**Calibration().positions, "more": [0.5, 0.5]})),
        json.dumps(spoiled(positions={name: [0.5, 1.5] for name in POSITIONS})),
        json.dumps(spoiled(pixels={"log_window": [1, 1], "lua_panel": [1, -1]})),
    ]:
        with subtests.test(content=content):
            file = tmp_path / "calibration.json"
            file.write_text(content)
            with pytest.raises(NotSetUpError, match="buildarena besiege calibrate"):
                load_calibration(file)


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
