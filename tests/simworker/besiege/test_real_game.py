"""What the real game does that no other does: levels, sizes, launchers, titles, other windows."""

import json
import os
import subprocess
import sys
from typing import Any

import pytest
from support.game.game_rig import SUPPORT, Rig, our_score, short_trial
from support.programs import captured

from buildarena_benchmark import builtin_tasks
from buildarena_besiege import level_file
from buildarena_simworker.besiege.screen.calibration import PathClick

pytestmark = [pytest.mark.nightly, pytest.mark.timeout(600)]


DIALOGS = ({"fault": "dialog"}, {"fault": "dialog", "at": "stop", "times": None})
FAULTS = (*DIALOGS, {"fault": "freeze", "seconds": 1.0}, {"fault": "crash"})
FAULTS += ({"fault": "clipboard_stolen", "times": 3}, {"fault": "lost_lines", "times": None})


def test_a_fault_ends_in_a_right_score_or_a_sentence_and_a_picture(clean, screen, subtests) -> None:
    for fault in FAULTS:
        with subtests.test(fault=fault):
            clean.faults.write_text(json.dumps([fault]))
            found = told(clean, screen)
            assert not list(clean.machines.iterdir())
            assert is_right(found, "transport-1") or (found["fault"] and found["pictures"])
            clean.end_game()


def told(rig: Rig, screen: dict[str, str], task: str = "transport-1", **more: str) -> Any:
    """What a runner says of one short trial."""
    changes = {f"BUILDARENA_BESIEGE_{name}": value for name, value in more.items()}
    words = [sys.executable, "-m", "support.game.one_run", str(rig.folder), task]
    told = {**os.environ, **rig.environment(), **screen, **changes}
    done = captured(words, env=told, within_s=280)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def is_right(found: Any, task: str) -> bool:
    right = our_score(*short_trial(task))
    return found == [right.success, pytest.approx(right.indicator, rel=0.02)]


def opened(rig: Rig, level: str) -> str:
    """The command that starts the game in a task's level."""
    file = rig.folder / "opened.blv"
    file.write_bytes(level_file(builtin_tasks()[level].scenario))
    return rig.game(f"--level={file}")


def test_a_bridge_in_another_level_is_a_fault_that_waits_for_a_person(clean, screen) -> None:
    game = opened(clean, "support-2")
    found = told(clean, screen, "support-1", LEVEL="support-1", COMMAND=game)
    assert "says that the level of support-1 is open, and it is not: at " in found["fault"]
    assert found["pictures"] == 1
    assert found["endless"]
    assert not list(clean.machines.iterdir())


def test_a_bridge_in_its_own_level_is_scored(clean, screen) -> None:
    game = opened(clean, "support-1")
    assert is_right(told(clean, screen, "support-1", LEVEL="support-1", COMMAND=game), "support-1")


def test_a_window_of_another_size_is_a_fault_that_names_both(clean, screen) -> None:
    clean.calibrate(window=(1100, 700), screen=(1100, 700))
    found = told(clean, screen)
    assert "the window is 1280x800, and was calibrated at 1100x700" in found["fault"]
    assert found["pictures"] == 3


def test_a_launcher_that_ends_stays_so_and_a_path_leads_to_the_level(clean, screen) -> None:
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
    clean.end_game()
    assert is_right(told(clean, screen, COMMAND=game), "transport-1")
    assert started.read_text() == 3 * "started\n"


def test_a_page_about_the_game_and_another_program_are_not_taken_for_it(clean, screen) -> None:
    page = (
        "import tkinter as tk; from support.game.stand_in_game.window import sign;"
        "a = tk.Tk(); a.title('besiege.md - Notepad'); a.geometry('400x300');"
        "b = tk.Toplevel(a); b.title('Besiege'); b.geometry('400x300+500+400');"
        "a.after(200, lambda: (sign(a), sign(b), print('shown', flush=True))); a.mainloop()"
    )
    environment = {**os.environ, **screen, "PYTHONPATH": SUPPORT}
    look = (
        "from buildarena_simworker.besiege.screen.window import open_windows;"
        "from buildarena_simworker.besiege.settings import BesiegeSettings;"
        "a = BesiegeSettings(title='Besiege', executable='Besiege.exe');"
        "b = BesiegeSettings(title='besiege', executable='');"
        "print(open_windows(a).find(), open_windows(b).find())"
    )
    words = [sys.executable, "-c", page]
    with subprocess.Popen(words, env=environment, stdout=subprocess.PIPE, text=True) as other:
        try:
            assert other.stdout is not None
            assert "shown\n" in iter(other.stdout.readline, "")
            found = captured([sys.executable, "-c", look], env=environment, within_s=30)
            assert found.stdout.startswith("None Area(left=500, top=400"), found.stdout
            assert is_right(told(clean, screen), "transport-1")
        finally:
            other.kill()
