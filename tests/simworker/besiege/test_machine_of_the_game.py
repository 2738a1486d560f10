"""What is installed, how commands are split, and what Windows says of windows and clipboards."""

import ctypes
import json
import re
import sys
from ctypes import wintypes
from types import SimpleNamespace

import pytest
from support.game.game_rig import MOD_XML, Rig, library, short_trial, trial_of

from buildarena_backend.trials.simulator import SimulatorFaultError
from buildarena_simworker.besiege import doctor
from buildarena_simworker.besiege.errors import (
    GameChangedError,
    NeedsPersonError,
    NotSetUpError,
    ScreenError,
)
from buildarena_simworker.besiege.game_lock import GameLock
from buildarena_simworker.besiege.installed import installed
from buildarena_simworker.besiege.screen import input as screen_input
from buildarena_simworker.besiege.screen.actions import strip_invisible
from buildarena_simworker.besiege.screen.calibration import Calibration, PathClick, load_calibration
from buildarena_simworker.besiege.screen.windows import Area, WindowIdentity
from buildarena_simworker.besiege.screen.windows_win32 import Win32Windows
from buildarena_simworker.besiege.settings import BesiegeSettings, _words
from buildarena_simworker.besiege.simulator import BesiegeSimulator


def test_build_and_mod_are_read_from_the_files_of_steam(tmp_path) -> None:
    found = installed(library(tmp_path))
    assert (found.build, found.mod) == ("25346", "1.4")
    assert found.as_facts() == {"build": "25346", "mod_file_version": "1.4"}


def test_a_mod_of_its_own_folder_is_found_one_level_down(tmp_path) -> None:
    mods = tmp_path / "Besiege_Data" / "Mods" / "LuaScripting"
    mods.mkdir(parents=True)
    (mods / "mod.xml").write_text(MOD_XML.format(name="Lua Scripting Mod", version="1.1.9", id="x"))
    assert installed(tmp_path).mod == "1.1.9"


def test_another_build_or_mod_than_the_calibrated_one_is_not_played(tmp_path, subtests) -> None:
    for changes, says in [
        ({"build": "25400"}, "the game's build was 25346 when it was calibrated and is 25400"),
        ({"version": "1.5"}, "the mod was 1.4 when it was calibrated and is 1.5"),
        ({"version": ""}, "and is not found"),
    ]:
        with subtests.test(changes=changes):
            kept = installed(library(tmp_path)).as_facts()
            installed(library(tmp_path)).require(kept)
            with pytest.raises(GameChangedError, match=says):
                installed(library(tmp_path, **changes)).require(kept)
            installed(library(tmp_path, **changes)).require({})


def test_the_doctor_names_a_command_that_starts_nothing(tmp_path, subtests) -> None:
    for command in ["/nowhere/besiege", 'C:\\Program "Files', "  "]:
        with subtests.test(command=command):
            found = doctor._command(BesiegeSettings(command=command, state=tmp_path))
            assert not found.ok
            assert "BUILDARENA_BESIEGE_COMMAND" in found.advice


def test_commands_are_split_as_windows_does(subtests) -> None:
    for command, words in [
        (
            r'"C:\Program Files (x86)\Steam\steam.exe" -applaunch 346010',
            [r"C:\Program Files (x86)\Steam\steam.exe", "-applaunch", "346010"],
        ),
        (r'D:\a\b.exe --level="{level}"', [r"D:\a\b.exe", "--level={level}"]),
        ("\ta  b\t", ["a", "b"]),
        ("", []),
    ]:
        with subtests.test(command=command):
            assert _words(command, windows=True) == words


def test_commands_are_split_as_a_shell_does_elsewhere() -> None:
    assert _words("'/a b/c' d\\ e", windows=False) == ["/a b/c", "d e"]
    for windows in (True, False):
        with pytest.raises(ValueError, match="quotation"):
            _words('"a b', windows=windows)


def test_a_name_is_compared_without_what_nobody_sees(subtests) -> None:
    for copied, shown in [
        ("ba1n0\u200b", "ba1n0"),
        ("\ufeffba1n0\u200d \r\n", "ba1n0"),
        ("\u2060ba1\u00adn0\u200e", "ba1n0"),
        ("ba1 n0", "ba1 n0"),
        ("", ""),
    ]:
        with subtests.test(copied=copied):
            assert strip_invisible(copied) == shown


class User32:
    """Windows' functions of windows, over some windows from the uppermost down."""

    def __init__(self, *windows: dict[str, object]) -> None:
        self.windows = dict(enumerate(windows, start=100))
        self.front = 0
        self.refuses = 1
        self.keys: list[int] = []

    def __getattr__(self, name):
        """The system's functions are written in capitals."""
        return getattr(self, re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower())

    def enum_windows(self, callback, _):
        for number in self.windows:
            if not callback(number, 0):
                break

    def is_window_visible(self, window):
        return self.windows[window].get("visible", True)

    def is_iconic(self, window):
        return self.windows[window].get("minimised", False)

    def get_window_text_w(self, window, text, size):
        text.value = str(self.windows[window]["title"])[: size - 1]

    def get_window_thread_process_id(self, window, number):
        pointer = ctypes.cast(number, ctypes.POINTER(wintypes.DWORD))
        pointer[0] = self.windows[window].get("pid", 0)

    def get_client_rect(self, window, rectangle):
        box = ctypes.cast(rectangle, ctypes.POINTER(wintypes.RECT))[0]
        box.right, box.bottom = self.windows[window].get("size", (1920, 1200))
        return 1

    def client_to_screen(self, _, point):
        corner = ctypes.cast(point, ctypes.POINTER(wintypes.POINT))[0]
        corner.x, corner.y = 320, 134
        return 1

    def show_window(self, window, _):
        self.windows[window]["minimised"] = False

    def set_foreground_window(self, window):
        self.refuses -= 1
        if self.refuses >= 0:
            return 0
        self.front = window
        return 1

    def keybd_event(self, key, *_):
        self.keys.append(key)

    def get_foreground_window(self):
        return self.front


GAME_WINDOW = WindowIdentity(title="Besiege", executable="Besiege")


def test_windows_gives_the_area_that_the_game_draws_to(monkeypatch) -> None:
    programs = {1: "notepad.exe", 2: "chrome.exe", 3: "Besiege.exe"}
    monkeypatch.setattr("psutil.Process", lambda pid: SimpleNamespace(name=lambda: programs[pid]))
    game = {"title": "Besiege", "pid": 2}
    hidden, low = {**game, "pid": 3, "visible": False}, {"title": "BESIEGE ", "pid": 3}
    others = (hidden, {**low, "minimised": True})
    system = User32({"title": "besiege.md - Notepad", "pid": 1}, game, *others)
    windows = Win32Windows(GAME_WINDOW, system)
    assert windows.process() == 3
    assert windows.find() is None, "it is minimised"
    assert not windows.is_active()
    windows.raise_()
    assert windows.is_active()
    assert system.keys == [18, 18], "Alt, as the first try did nothing"
    assert windows.find() == Area(320, 134, 1920, 1200)
    assert Win32Windows(GAME_WINDOW, User32()).find() is None


def test_a_clipboard_that_another_program_keeps_is_waited_for_and_then_a_fault(monkeypatch) -> None:
    busy = 3

    def paste() -> str:
        nonlocal busy
        busy -= 1
        if busy >= 0:
            raise RuntimeError("Error calling OpenClipboard")
        return "text"

    system = SimpleNamespace(PyperclipException=RuntimeError, paste=paste, copy=lambda _: paste())
    monkeypatch.setitem(sys.modules, "pyperclip", system)
    monkeypatch.setattr(screen_input, "TRY_AGAIN_S", 0.0)
    reached = screen_input._SystemClipboard()
    assert reached.get() == "text"
    for use in (reached.get, lambda: reached.put("x")):
        busy = 1000
        with pytest.raises(ScreenError, match="another program keeps it"):
            use()


def test_a_lock_is_of_one_game_and_ends() -> None:
    first = GameLock("a game of this test")
    with pytest.raises(NotSetUpError, match="another runner plays this game"):
        GameLock("a game of this test")
    GameLock("another game of this test").release()
    first.release()
    first.release()
    GameLock("a game of this test").release()


def test_a_lease_goes_back_when_the_game_is_another(tmp_path, rig: Rig) -> None:
    class Changed:
        def require_able(self, _run):
            found = installed(library(tmp_path, build="2"))
            found.require({"build": "1"})

    settings = BesiegeSettings(game="1.75-23370", mod="1.4", state=rig.folder)
    with pytest.raises(SimulatorFaultError, match="the game's build was 1 ") as fault:
        BesiegeSimulator(settings, Changed(), {}).run(trial_of(*short_trial("transport-1")))
    assert issubclass(GameChangedError, NeedsPersonError)
    assert (fault.value.endless, fault.value.delay_s) == (True, 60.0)


def test_a_calibration_keeps_versions_sizes_and_path(tmp_path) -> None:
    path, screen = (PathClick(0.5, 0.25, 12.5),), (1920, 1200)
    made = Calibration(window=screen, screen=screen, installed={"build": "1"}, path=path)
    made.save(tmp_path / "c.json")
    assert load_calibration(tmp_path / "c.json") == made
    content = json.loads((tmp_path / "c.json").read_text())
    for path in ([{"x": 2, "y": 0, "wait_s": 1}], [{"x": 0.5}], "no", [1], [{"x": "a"}]):
        (tmp_path / "c.json").write_text(json.dumps({**content, "path": path}))
        with pytest.raises(NotSetUpError, match="calibrate --path"):
            load_calibration(tmp_path / "c.json")
