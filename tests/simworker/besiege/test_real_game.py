"""What the real game does that no other does: levels, sizes, launchers, titles, other windows."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import psutil
import pytest
from support.game.game_rig import SUPPORT, Rig, our_score, short_trial

from buildarena_benchmark import builtin_tasks
from buildarena_besiege import level_file
from buildarena_simworker.besiege.screen.calibration import PathClick

pytestmark = [pytest.mark.nightly, pytest.mark.timeout(300)]


@pytest.fixture
def clean(rig: Rig) -> Iterator[Rig]:
    """Ends the game that a program leaves running."""
    yield rig
    known = rig.folder / "state" / "game.json"
    if known.exists():
        psutil.Process(json.loads(known.read_text())["pid"]).kill()


def told(rig: Rig, screen: dict[str, str], task: str = "transport-1", **more: str) -> Any:
    """What a runner says of one short trial."""
    changes = {f"BUILDARENA_BESIEGE_{name}": value for name, value in more.items()}
    done = subprocess.run(
        [sys.executable, "-m", "support.game.one_run", str(rig.folder), task],
        env={**os.environ, **rig.environment(), **screen, **changes},
        capture_output=True,
        text=True,
        timeout=280,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def is_right(found: Any, task: str) -> bool:
    right = our_score(*short_trial(task))
    return found == [right.success, pytest.approx(right.indicator, rel=0.02)]


@pytest.mark.parametrize("opened", ["", "support-2"])
def test_a_bridge_in_another_level_is_a_fault_that_waits_for_a_person(
    clean, screen, tmp_path, opened
) -> None:
    options = []
    if opened:
        file = tmp_path / "opened.blv"
        file.write_bytes(level_file(builtin_tasks()[opened].scenario))
        options = [f"--level={file}"]
    game = clean.game(*options)
    found = told(clean, screen, "support-1", LEVEL="support-1", COMMAND=game)
    assert "says that the level of support-1 is open, and it is not: at " in found["fault"]
    assert found["pictures"] == 1
    assert found["endless"]
    assert not list(clean.machines.iterdir())


@pytest.mark.parametrize("worked", [True, False])
def test_a_calibration_is_tried_in_the_level_that_is_open(clean, screen, tmp_path, worked) -> None:
    file = tmp_path / "opened.blv"
    file.write_bytes(level_file(builtin_tasks()["support-1"].scenario))
    changes = {
        "BUILDARENA_BESIEGE_COMMAND": clean.game(*([f"--level={file}"] if worked else [])),
        "BUILDARENA_BESIEGE_LEVEL": "support-1",
    }
    done = subprocess.run(
        [sys.executable, "-m", "buildarena_simworker.besiege", "calibrate", "--try"],
        env={**os.environ, **clean.environment(), **screen, **changes},
        capture_output=True,
        text=True,
        timeout=200,
        check=False,
    )
    shown = "Loaded, started, read" if worked else "the level of support-1 is open, and it is not"
    assert shown in done.stdout, done.stderr
    assert done.returncode == (0 if worked else 1)


def test_a_bridge_in_its_own_level_is_scored(clean, screen, tmp_path) -> None:
    file = tmp_path / "opened.blv"
    file.write_bytes(level_file(builtin_tasks()["support-1"].scenario))
    game = clean.game(f"--level={file}")
    assert is_right(told(clean, screen, "support-1", LEVEL="support-1", COMMAND=game), "support-1")


def test_a_window_of_another_size_is_a_fault_that_names_both(clean, screen) -> None:
    clean.calibrate(window=(1100, 700), screen=(1100, 700))
    found = told(clean, screen)
    assert "the window is 1280x800, and was calibrated at 1100x700" in found["fault"]
    assert found["pictures"] == 3


def test_what_the_game_says_of_its_size_counts_too(clean, screen) -> None:
    clean.calibrate(screen=(2560, 1600))
    found = told(clean, screen)
    assert "the game draws 1280x800, and was calibrated at 2560x1600" in found["fault"]


def test_a_launcher_that_ends_is_not_started_again_and_a_path_leads_to_the_level(
    clean, screen
) -> None:
    clean.calibrate(path=(PathClick(0.5, 0.55, 4.0), PathClick(0.8, 0.45, 4.0)))
    started = clean.folder / "started.txt"
    game = clean.game("--title-screen", launcher=started)
    assert is_right(told(clean, screen, COMMAND=game), "transport-1")
    assert started.read_text() == "started\n"
    # Another runner finds the same game by its window.
    (clean.folder / "state" / "game.json").unlink()
    assert is_right(told(clean, screen, COMMAND=game), "transport-1")
    assert started.read_text() == "started\n"
    # One that is gone is started again, and one that freezes then once more.
    clean.faults.write_text(json.dumps([{"fault": "freeze", "at": "open_folder"}]))
    known = json.loads((clean.folder / "state" / "game.json").read_text())
    psutil.Process(known["pid"]).kill()
    assert is_right(told(clean, screen, COMMAND=game), "transport-1")
    assert started.read_text() == 3 * "started\n"


def test_a_page_about_the_game_and_another_program_are_not_taken_for_it(clean, screen) -> None:
    page = (
        "import tkinter as tk; from stand_in_game.ownership import sign;"
        "a = tk.Tk(); a.title('besiege.md - Notepad'); a.geometry('400x300');"
        "b = tk.Toplevel(a); b.title('Besiege'); b.geometry('400x300+500+400');"
        "a.after(200, lambda: (sign(a), sign(b), print('shown', flush=True))); a.mainloop()"
    )
    environment = {**os.environ, **screen, "PYTHONPATH": SUPPORT}
    look = (
        "from buildarena_simworker.besiege.screen.windows import *;"
        "from buildarena_simworker.besiege.screen.window_types import *;"
        "w = Wanted(title='Besiege', executable='Besiege.exe');"
        "print(open_windows(w).find(), open_windows(Wanted(title='besiege')).find())"
    )
    with subprocess.Popen(
        [sys.executable, "-c", page], env=environment, stdout=subprocess.PIPE, text=True
    ) as other:
        try:
            assert other.stdout is not None
            assert "shown\n" in iter(other.stdout.readline, "")
            found = subprocess.run(
                [sys.executable, "-c", look],
                env=environment,
                capture_output=True,
                text=True,
                check=True,
                timeout=30,
            )
            assert found.stdout.startswith("None Area(left=500, top=400"), found.stdout
            assert is_right(told(clean, screen), "transport-1")
        finally:
            other.kill()


def test_a_second_runner_of_the_same_screen_does_not_start(clean, screen) -> None:
    program = (
        "from buildarena_simworker.besiege.game_lock import *; import time;"
        "lock = GameLock(screen_name()); print('held', flush=True); time.sleep(60)"
    )
    environment = {**os.environ, **clean.environment(), **screen, "PYTHONPATH": SUPPORT}
    with subprocess.Popen(
        [sys.executable, "-c", program], env=environment, stdout=subprocess.PIPE, text=True
    ) as first:
        try:
            assert first.stdout is not None
            assert first.stdout.readline() == "held\n"
            done = subprocess.run(
                [sys.executable, "-m", "buildarena_simworker.besiege", "calibrate", "--try"],
                env=environment,
                capture_output=True,
                text=True,
                timeout=60,
                check=False,
            )
        finally:
            first.kill()
    assert done.returncode == 1
    assert f"another runner plays this game (process {first.pid})" in done.stderr
    assert is_right(told(clean, screen), "transport-1"), "a lock ends with its process"
