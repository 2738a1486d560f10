"""Mouse, keyboard and clipboard of a screen; the only module that uses PyAutoGUI."""

from __future__ import annotations

import contextlib
import io
import os
import sys
import time
from pathlib import Path
from typing import Any, Final

from buildarena_simworker_besiege.errors import DesktopError, NotSetUpError
from buildarena_simworker_besiege.screen.clipboard import open_clipboard

MODIFIERS: Final = ("ctrl", "shift", "alt", "command", "win")
SELECT: Final = "command" if sys.platform == "darwin" else "ctrl"
"""The modifier of "select all" and "copy"."""
SENTINEL: Final = "nothing was copied"
"""Put into the clipboard before copying: when it is still there, nothing was copied."""


class ScreenInput:
    """Moves the mouse, types and copies, as a person does.

    Args:
        pace: Factor by which all waits are shorter than usual.

    Raises:
        NotSetUpError: There is no screen, or the extra `besiege` is not installed.
    """

    def __init__(self, pace: float = 1.0) -> None:
        self._pace = pace
        _need_no_authority()
        try:
            # Xlib prints what it misses to standard output, which is for results.
            with contextlib.redirect_stdout(io.StringIO()):
                import pyautogui
        except ImportError as error:
            raise NotSetUpError(
                "playing the game needs `pip install buildarena-simworker-besiege[window]` "
                f"({error})"
            ) from error
        except Exception as error:
            raise NotSetUpError(f"there is no screen to play on: {error}") from error
        pyautogui.PAUSE = 0.0
        self._gui: Any = pyautogui
        self._clipboard = open_clipboard()

    def wait(self, seconds: float) -> None:
        """Waits as long as a game needs at the usual pace."""
        time.sleep(seconds / self._pace)

    def click(self, x: int, y: int) -> None:
        """A slow click: games miss fast ones."""
        gui = self._gui
        with _stopped_by_hand(gui):
            gui.moveTo(x, y)
            self.wait(0.1)
            gui.mouseDown()
            self.wait(0.05)
            gui.mouseUp()

    def move(self, x: int, y: int) -> None:
        """Moves the mouse."""
        with _stopped_by_hand(self._gui):
            self._gui.moveTo(x, y)

    def screen_size(self) -> tuple[int, int]:
        """Width and height of the screen, pixels."""
        size = self._gui.size()
        return (int(size.width), int(size.height))

    def position(self) -> tuple[int, int]:
        """Where the mouse is."""
        point = self._gui.position()
        return (int(point.x), int(point.y))

    def press(self, key: str) -> None:
        """Presses and releases one key."""
        with _stopped_by_hand(self._gui):
            self._gui.press(key)

    def hotkey(self, *keys: str) -> None:
        """Presses keys together; whatever happens, none stays down."""
        with _stopped_by_hand(self._gui):
            try:
                self._gui.hotkey(*keys)
            finally:
                for key in keys:
                    self._gui.keyUp(key)

    def write(self, text: str) -> None:
        """Types a text of letters and digits."""
        with _stopped_by_hand(self._gui):
            self._gui.write(text)

    def release_all(self) -> None:
        """Releases all keys and buttons that a runner that died may have held."""
        for key in MODIFIERS:
            self._gui.keyUp(key)
        self._gui.mouseUp()

    def close(self) -> None:
        """Releases keys and clipboard."""
        self.release_all()
        self._clipboard.close()

    def clear_clipboard(self) -> None:
        """Marks the clipboard, so that a later copy can be recognised."""
        self._clipboard.put(SENTINEL)

    def copy_all(self) -> str | None:
        """Selects and copies everything where the keyboard is; None when nothing was copied."""
        self.clear_clipboard()
        self.hotkey(SELECT, "a")
        self.wait(0.2)
        self.hotkey(SELECT, "c")
        self.wait(0.2)
        text = self._clipboard.get()
        return None if text is None or text == SENTINEL else text


def _need_no_authority() -> None:
    """Python's Xlib insists on a file of authorities, also on a screen that asks for none."""
    if sys.platform in {"win32", "darwin"} or "XAUTHORITY" in os.environ:
        return
    if not Path("~/.Xauthority").expanduser().exists():
        os.environ["XAUTHORITY"] = os.devnull


class _stopped_by_hand:  # noqa: N801 - reads as a statement
    """Turns PyAutoGUI's fail-safe, the mouse in the screen's corner, into our own error."""

    def __init__(self, gui: Any) -> None:
        self._gui = gui

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: type[BaseException] | None, error: object, _: object) -> None:
        if kind is not None and issubclass(kind, self._gui.FailSafeException):
            raise DesktopError("somebody moved the mouse into the screen's corner to stop")
