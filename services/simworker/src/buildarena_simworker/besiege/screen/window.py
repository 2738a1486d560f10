"""A game with a window, driven by mouse and keyboard.

The steps are those of the published runner; each is verified by what can be seen: the clipboard,
the pixels near what was clicked, the log.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from contextlib import suppress
from typing import TYPE_CHECKING, Any, Final

from buildarena_benchmark import builtin_tasks
from buildarena_besiege import GameLog, GameRun, level_file, level_finding, trajectory_of
from buildarena_geometry import Machine
from buildarena_simulation import Scenario, Trajectory
from buildarena_simworker.besiege.errors import (
    DesktopError,
    GameGoneError,
    LevelClosedError,
    NotSetUpError,
    ScreenError,
    StepFailedError,
    WrongLevelError,
)
from buildarena_simworker.besiege.game_lock import GameLock, screen_name
from buildarena_simworker.besiege.installed import installed
from buildarena_simworker.besiege.process import GameProcess
from buildarena_simworker.besiege.screen.actions import (
    ATTEMPTS,
    ScreenActions,
    load_by_name,
    start_game,
    wait_for,
)
from buildarena_simworker.besiege.screen.calibration import Calibration, load_calibration
from buildarena_simworker.besiege.screen.input import ScreenInput
from buildarena_simworker.besiege.screen.view import View, difference, screenshot
from buildarena_simworker.besiege.screen.windows import WindowIdentity, Windows
from buildarena_simworker.besiege.settings import BesiegeSettings, level_digest
from buildarena_simworker.besiege.traces import Traces

if TYPE_CHECKING:
    from PIL.Image import Image

LIKE_EMPTY: Final = 0.35
"""Difference from an empty window below which it counts as empty, as a share of the change by a
loaded machine."""


class WindowDesktop:
    """A game in a window.

    Args:
        settings: Title, folders and command.
        calibration: Positions to click.
        windows: Windows of the screen.
    """

    def __init__(
        self,
        settings: BesiegeSettings,
        calibration: Calibration,
        screen_input: ScreenInput,
        windows: Windows,
    ) -> None:
        self._settings = settings
        self._limits = settings.time_limits
        self._calibration = calibration
        self._lock = GameLock(screen_name())
        self._view = View(calibration, windows)
        self._input = screen_input
        self._windows = windows
        self._process = GameProcess(settings)
        self._actions = ScreenActions(
            self._view, screen_input, windows, self._limits, self.is_alive
        )
        self._traces = Traces(settings.state)
        self._empty: Image | None = None
        self._level: bytes | None = None
        self._loaded_changed = 0.0
        self._panel_shown = False
        self._early_copies: list[str] = []

    def require_able(self, run: GameRun) -> None:
        """Check that the calibrated game runs, with the run's level open or to be opened."""
        installed(self._settings.folder).require(self._calibration.installed)
        if self._settings.opens_levels:
            return
        digest = level_digest(run.level)
        if digest != self._open_level():
            raise LevelClosedError(
                f"the game has the level of {self._settings.level or 'the sandbox'} open, and this "
                "task needs another: write it with `buildarena besiege level TASK --out FILE.blv`, "
                "open it in the game, and set BUILDARENA_BESIEGE_LEVEL to the task's name"
            )

    def prepare(self, run: GameRun) -> None:
        """Bring an empty game with the run's level to the front."""
        self._input.release_all()
        left = self._traces.left
        self._traces.remove()
        other_level = self._settings.opens_levels and self._process.level != level_digest(run.level)
        doubtful = left and self._process.can_start
        if other_level or doubtful or not self.is_alive():
            self._start_anew(run.level)
        elif left:
            self._tidy()
        self._level = run.level
        self._actions.to_front()
        self._actions.step(
            "look at the window", self._windows.raise_, self._view.size_finding, attempts=1
        )
        self._empty = self._view.whole()

    def load(self, run: GameRun) -> None:
        """Load the machine by its name, and read back the typed name."""
        folder = self._settings.machines_folder
        if folder is None or not folder.is_dir():
            raise DesktopError(f"the folder of machine files {folder} does not exist")
        self._traces.put(folder / f"{run.name}.bsg", run.machine_file)
        self._actions.by_attempts(lambda: self._load(run.name))
        if run.set_ground:
            self._actions.click("set_ground")
            self._input.wait(0.5)

    def start(self, run: GameRun) -> None:
        """Start, and show the mod's log until it contains the run's begin line.

        The log is drawn only after something was printed, so the state of the mod's panel is
        unknown before: Ctrl+L is right if the begin line can be copied afterwards, and is pressed
        once more if not.
        """
        self._early_copies.clear()
        self._input.wait(0.3)
        self._actions.click("start")
        self._actions.step(
            "show the log",
            lambda: self._input.hotkey("ctrl", "l"),
            lambda: self._no_begin_line(run),
            timeout_s=self._limits.begin_s / ATTEMPTS,
        )
        self._panel_shown = True

    def _no_begin_line(self, run: GameRun) -> str | None:
        text = self.read_log()
        self._early_copies.append(text)
        begun = GameLog(run.run_id)
        begun.read(text)
        return None if begun.begun else "the begin line of the run is not in what was copied"

    def new_log(self, run: GameRun) -> GameLog:
        """Return a log that collects the run's lines, with those copied at its start."""
        log = GameLog(run.run_id)
        for text in self._early_copies:
            log.read(text)
        return log

    def require_level(self, run: GameRun, log: GameLog) -> None:
        """Check the run's measurements: the level, and the size of the game's picture."""
        world = log.world
        if world is None:
            return
        expected = self._calibration.screen
        if expected is not None and world.screen != expected:
            raise ScreenError(
                f"the game draws {_size(world.screen)}, and was calibrated at {_size(expected)}"
            )
        finding = level_finding(world, run.scenario)
        if finding is not None and self._settings.opens_levels:
            raise WrongLevelError(f"another level is open than the task's: {finding}")
        if finding is not None:
            opened = self._settings.level or "the sandbox"
            raise LevelClosedError(
                f"BUILDARENA_BESIEGE_LEVEL says that the level of {opened} is open, and it is not: "
                f"{finding}; open it in the game"
            )

    def trajectory(self, log: GameLog, machine: Machine, scenario: Scenario) -> Trajectory:
        """Return the run's trajectory from its lines."""
        game, mod = self._settings.game, self._settings.mod
        return trajectory_of(log, machine, scenario, game=game, mod=mod)

    def read_log(self) -> str:
        """Return a copy of the log window."""
        self._actions.click("log_window")
        return self._input.copy_all() or ""

    def print_lines(self, run: GameRun) -> None:
        """Load and start a machine and show the mod's log, for a person to point at."""
        self.prepare(run)
        self.load(run)
        self._actions.click("start")
        self._input.wait(1.0)
        self._input.hotkey("ctrl", "l")
        self._panel_shown = True

    def stop(self) -> None:
        """Stop the simulation, which ends its lines."""
        self._actions.step("stop the simulation", self._click_start, self._still_moves)

    def clear(self) -> None:
        """Delete the machine, until the window looks as it did without one."""
        self._actions.click("empty_space")
        self._input.wait(0.3)
        if self._panel_shown:
            self._input.hotkey("ctrl", "l")
            self._panel_shown = False
            self._input.wait(0.3)
        self._actions.step("delete the machine", self._delete, self._still_there)
        self._traces.remove()

    def recover(self) -> None:
        """Close dialogs and take the keyboard back."""
        self._actions.recover()

    def is_alive(self) -> bool:
        """Check if the game has a window, including that of a game started by a person."""
        if self._windows.find() is None:
            return False
        if self._process.can_start and not self._process.is_running():
            self._process.adopt(self._windows.process())
            return self._process.is_running()
        return True

    def restart(self) -> None:
        """Kill the game and start it again with the level it had."""
        self._input.release_all()
        if not self._process.can_start:
            raise GameGoneError(
                "the game must be restarted, and BUILDARENA_BESIEGE_COMMAND is not set: "
                "start it again by hand"
            )
        self._start_anew(self._level)
        self._traces.remove()

    def screenshot(self) -> bytes | None:
        """Return the whole screen."""
        return screenshot()

    def close(self) -> None:
        """Release the keys, and end the game if it was started here."""
        try:
            with suppress(DesktopError):
                self._input.close()
        finally:
            if self._process.started:
                self._process.kill()
            self._traces.remove()
            self._lock.release()

    def _start_anew(self, level: bytes | None) -> None:
        self._panel_shown = False
        start_game(self._process, self._actions, level, self._calibration.path)

    def _load(self, name: str) -> None:
        load_by_name(self._actions, name)
        self._saw_machine(name)

    def _open_level(self) -> str:
        """Return the digest of the level declared open by the owner."""
        if not self._settings.level:
            return level_digest(None)
        task = builtin_tasks().get(self._settings.level)
        if task is None:
            names = ", ".join(builtin_tasks())
            raise LevelClosedError(
                f"BUILDARENA_BESIEGE_LEVEL: no task {self._settings.level!r}; there are {names}"
            )
        return level_digest(level_file(task.scenario))

    def _tidy(self) -> None:
        """Clean up a game by hand after a dead runner."""
        self.recover()
        self._actions.click("empty_space")
        self._delete()
        self._input.press("escape")

    def _saw_machine(self, name: str) -> None:
        """Record how much a loaded machine changes the window."""
        finding = wait_for(
            lambda: None if self._changed_since_empty() > 0.0 else "the window shows no machine",
            timeout_s=self._limits.effect_s,
        )
        if finding is not None:
            raise StepFailedError(f"load the machine {name}", finding)
        self._loaded_changed = self._changed_since_empty()

    def _changed_since_empty(self) -> float:
        return 1.0 if self._empty is None else difference(self._view.whole(), self._empty)

    def _still_there(self) -> str | None:
        changed = self._changed_since_empty()
        if changed <= LIKE_EMPTY * self._loaded_changed:
            return None
        return "the window does not look as it did without a machine"

    def _delete(self) -> None:
        self._actions.click("delete")
        self._input.wait(0.5)
        self._actions.click("confirm")
        self._input.wait(0.5)

    def _click_start(self) -> None:
        self._actions.click("start")
        self._input.wait(0.5)

    def _still_moves(self) -> str | None:
        before = self.read_log()
        self._input.wait(0.7)
        return None if before == self.read_log() else "lines are still added to the log"


def _size(size: tuple[int, int]) -> str:
    return f"{size[0]}x{size[1]}"


def make_desktop(settings: BesiegeSettings) -> tuple[WindowDesktop, Mapping[str, Any]]:
    """Return the game, and a manifest's data on how it is driven.

    Raises:
        NotSetUpError: Something is missing; the message has the remedy.
    """
    folder = settings.machines_folder
    if folder is None or not folder.is_dir():
        raise NotSetUpError(
            f"there is no folder of machine files {folder}: set BUILDARENA_BESIEGE_FOLDER to the "
            "game's folder, or BUILDARENA_BESIEGE_MACHINES to the folder itself"
        )
    calibration = load_calibration(settings.calibration_file)
    screen_input = ScreenInput(settings.pace)
    desktop = WindowDesktop(settings, calibration, screen_input, open_windows(settings))
    facts = {
        "calibration": calibration.digest,
        "screen": "x".join(map(str, screen_input.screen_size())),
        **installed(settings.folder).as_facts(),
    }
    return desktop, facts


def open_windows(settings: BesiegeSettings) -> Windows:
    """Return the windows of this machine's screen.

    Raises:
        NotSetUpError: The screen is missing.
    """
    identity = WindowIdentity(title=settings.title, executable=settings.executable)
    if sys.platform in {"win32", "cygwin"}:
        from buildarena_simworker.besiege.screen.windows_win32 import Win32Windows

        return Win32Windows(identity)
    from buildarena_simworker.besiege.screen.windows_x11 import X11Windows

    return X11Windows(identity)
