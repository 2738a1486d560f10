"""A game with a window, driven by mouse and keyboard.

The steps are those of the published runner; each is verified by what can be seen: the clipboard,
the pixels near what was clicked, the log.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Final

from buildarena_benchmark import builtin_tasks
from buildarena_besiege import GameLog, GameRun, level_file, trajectory_of
from buildarena_geometry import Machine
from buildarena_simulation import Scenario, Trajectory
from buildarena_simworker_besiege.desktop import RunLog
from buildarena_simworker_besiege.errors import (
    DesktopError,
    GameGoneError,
    LevelClosedError,
    StepFailedError,
)
from buildarena_simworker_besiege.log_sources import LogFile
from buildarena_simworker_besiege.process import GameProcess
from buildarena_simworker_besiege.screen.calibration import Calibration
from buildarena_simworker_besiege.screen.capture import difference, screenshot
from buildarena_simworker_besiege.screen.input import SELECT, ScreenInput
from buildarena_simworker_besiege.screen.steps import ATTEMPTS, take_step, wait_for
from buildarena_simworker_besiege.screen.view import View
from buildarena_simworker_besiege.screen.windows import Windows
from buildarena_simworker_besiege.settings import BesiegeSettings, level_digest
from buildarena_simworker_besiege.traces import Traces

if TYPE_CHECKING:
    from PIL.Image import Image

LIKE_EMPTY: Final = 0.35
"""A window is empty again when it differs from an empty one by less than this share of what a
loaded machine changed."""


class WindowDesktop:
    """Plays a game in a window.

    Args:
        settings: Title, folders and command.
        calibration: Where to click.
        screen_input: Mouse, keyboard and clipboard.
        windows: The screen's windows.
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
        self._view = View(settings.title, calibration, windows)
        self._input = screen_input
        self._windows = windows
        self._process = GameProcess(settings)
        self._traces = Traces(settings.state)
        self._log_file = None if settings.log_file is None else LogFile(settings.log_file)
        self._empty: Image | None = None
        self._level: bytes | None = None
        self._loaded_changed = 0.0
        self._panel_shown = False

    @property
    def puts_down(self) -> bool:
        """It has a button for that."""
        return True

    def require_able(self, run: GameRun) -> None:
        """Checks that the run's level is open, or can be opened."""
        if self._settings.opens_levels:
            return
        wanted = level_digest(run.level)
        if wanted != self._open_level():
            raise LevelClosedError(
                f"the game has the level of {self._settings.level or 'the sandbox'} open, and this "
                "task needs another: write it with `buildarena besiege level TASK --out FILE.blv`, "
                "open it in the game, and set BUILDARENA_BESIEGE_LEVEL to the task's name"
            )

    def prepare(self, run: GameRun) -> None:
        """Brings an empty game with the run's level to the front."""
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
        self._to_front()
        self._empty = self._view.whole()

    def load(self, run: GameRun) -> None:
        """Loads the machine by its name; the name that was typed is read back."""
        folder = self._settings.machines_folder
        if folder is None or not folder.is_dir():
            raise DesktopError(f"the folder of machine files {folder} does not exist")
        self._traces.put(folder / f"{run.name}.bsg", run.machine_file)
        self._by_attempts(lambda: self._load_by_name(run.name))
        if run.set_ground:
            self._click("set_ground")
            self._input.wait(0.5)

    def start(self, run: GameRun) -> None:
        """Shows the Lua panel and starts."""
        del run  # each line of the log names its run
        if self._log_file is not None:
            self._log_file.skip()
        else:
            self._opened("show the Lua panel", None, "log_window")
            self._panel_shown = True
        self._input.wait(0.3)
        self._click("start")

    def new_log(self, run: GameRun) -> GameLog:
        """An empty log that collects the run's lines."""
        return GameLog(run.run_id)

    def trajectory(self, log: RunLog, machine: Machine, scenario: Scenario) -> Trajectory:
        """The run's trajectory from its lines."""
        assert isinstance(log, GameLog)  # noqa: S101 - it is of `new_log`
        game, mod = self._settings.game, self._settings.mod
        return trajectory_of(log, machine, scenario, game=game, mod=mod)

    def read_log(self) -> str:
        """A copy of the log window, or what the file brought."""
        if self._log_file is not None:
            return self._log_file.read()
        self._click("log_window")
        return self._input.copy_all() or ""

    def stop(self) -> None:
        """Stops the simulation: its lines come to an end."""
        if self._log_file is None:
            self._step("stop the simulation", self._click_start, self._still_moves)
        else:
            self._click_start()

    def clear(self) -> None:
        """Deletes the machine, until the window looks as it did without one."""
        self._click("empty_space")
        self._input.wait(0.3)
        if self._panel_shown:
            self._input.hotkey("ctrl", "l")
            self._panel_shown = False
            self._input.wait(0.3)
        self._step("delete the machine", self._delete, self._still_there)
        self._traces.remove()

    def recover(self) -> None:
        """Closes dialogs and takes the keyboard back."""
        self._input.release_all()
        self._input.press("escape")
        self._input.wait(0.2)
        self._windows.raise_(self._settings.title)
        self._input.wait(0.2)

    def is_alive(self) -> bool:
        """Whether the game has a window, and runs, if it was started here."""
        if self._process.can_start and not self._process.is_running():
            return False
        return self._windows.find(self._settings.title) is not None

    def restart(self) -> None:
        """Kills the game and starts it again with the level it had."""
        self._input.release_all()
        if not self._process.can_start:
            raise GameGoneError(
                "the game must be restarted, and BUILDARENA_BESIEGE_COMMAND is not set: "
                "start it again by hand"
            )
        self._start_anew(self._level)
        self._traces.remove()

    def screenshot(self) -> bytes | None:
        """The whole screen."""
        return screenshot()

    def close(self) -> None:
        """Lets go of the keys, and ends the game if it was started here."""
        self._input.close()
        self._process.kill()
        self._traces.remove()

    def _start_anew(self, level: bytes | None) -> None:
        self._process.kill()
        self._process.start(level)
        self._panel_shown = False
        title = self._settings.title
        finding = wait_for(lambda: self._no_window(title), timeout_s=self._limits.start_s)
        if finding is not None:
            raise GameGoneError(
                f"the game showed no window with {title!r} in its title within "
                f"{self._limits.start_s:.0f} s: {finding}"
            )
        self._input.wait(1.0)

    def _no_window(self, title: str) -> str | None:
        if not self._process.is_running():
            raise GameGoneError(f"the game ended as it started: {self._process.last_words()}")
        if self._windows.find(title) is None:
            return f"what it printed is in {self._process.output}"
        return None

    def _open_level(self) -> str:
        """Digest of the level that the owner says is open."""
        if not self._settings.level:
            return level_digest(None)
        task = builtin_tasks().get(self._settings.level)
        if task is None:
            known = ", ".join(builtin_tasks())
            raise LevelClosedError(
                f"BUILDARENA_BESIEGE_LEVEL: no task {self._settings.level!r}; there are {known}"
            )
        return level_digest(level_file(task.scenario))

    def _to_front(self) -> None:
        title = self._settings.title
        self._step(
            "bring the game to the front",
            lambda: self._windows.raise_(title),
            lambda: None if self._windows.is_active(title) else "another window has the keyboard",
        )
        self._input.wait(0.5)

    def _tidy(self) -> None:
        """Takes out of a game what a dead runner left, by hand."""
        self.recover()
        self._click("empty_space")
        self._click("delete")
        self._input.wait(0.5)
        self._click("confirm")
        self._input.wait(0.5)
        self._input.press("escape")

    def _load_by_name(self, name: str) -> None:
        """Opens the list of machines, types the name, loads; a failure leaves the list closed."""
        self._opened("open the list of machines", "open_folder", "name_box")
        self._type_name(name)
        panel = self._view.patch("name_box")
        self._step(
            f"load the machine {name}",
            lambda: self._click("open_machine"),
            lambda: (
                None
                if self._view.differs("name_box", panel)
                else "the list of machines stayed open, so the game did not find or read its file"
            ),
            timeout_s=self._limits.load_s,
            attempts=1,
        )
        self._saw_machine(name)

    def _type_name(self, name: str) -> None:
        def retype() -> None:
            self._click("name_box")
            self._input.wait(0.5)
            self._input.hotkey(SELECT, "a")
            self._input.wait(0.2)
            self._input.press("backspace")
            self._input.wait(0.2)
            self._input.write(name)
            self._input.wait(0.1 * len(name))

        def read_back() -> str | None:
            typed = self._input.copy_all()
            if typed is not None and typed != name and typed.casefold() == name:
                self._input.press("capslock")
            return None if typed == name else f"{typed!r} stands there instead"

        self._step(f"type the name {name}", retype, read_back, timeout_s=0.0, attempts=1)

    def _by_attempts(self, act: Callable[[], None]) -> None:
        """Does something of several steps again from its beginning when one of them fails."""
        for left in reversed(range(ATTEMPTS)):
            try:
                act()
            except StepFailedError:
                if not left:
                    raise
                self.recover()
            else:
                return

    def _saw_machine(self, name: str) -> None:
        """Notes how much a loaded machine changes the window."""
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
        self._click("delete")
        self._input.wait(0.5)
        self._click("confirm")
        self._input.wait(0.5)

    def _click_start(self) -> None:
        self._click("start")
        self._input.wait(0.5)

    def _still_moves(self) -> str | None:
        before = self.read_log()
        self._input.wait(0.7)
        return None if before == self.read_log() else "lines are still added to the log"

    def _opened(self, name: str, click: str | None, seen_at: str) -> None:
        """Opens a panel: with a click, or by Ctrl+L; the patch where it lies changes."""
        before = self._view.patch(seen_at)

        def act() -> None:
            if self._view.differs(seen_at, before):
                return
            if click is None:
                self._input.hotkey("ctrl", "l")
            else:
                self._click(click)

        self._step(
            name,
            act,
            lambda: (
                None
                if self._view.differs(seen_at, before)
                else "nothing changed in the window where it should appear"
            ),
        )

    def _step(
        self,
        name: str,
        act: Callable[[], None],
        finding: Callable[[], str | None],
        *,
        timeout_s: float | None = None,
        attempts: int = ATTEMPTS,
    ) -> None:
        def alive() -> str | None:
            if not self.is_alive():
                raise GameGoneError(f"{name}: the game is gone")
            return finding()

        limit = self._limits.effect_s if timeout_s is None else timeout_s
        take_step(name, act, alive, timeout_s=limit, recover=self.recover, attempts=attempts)

    def _click(self, place: str) -> None:
        self._input.click(*self._view.point(place))
        self._input.wait(0.1)
