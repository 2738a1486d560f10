"""Mouse, keyboard and clipboard of a screen; the only module that uses PyAutoGUI."""

from __future__ import annotations

import contextlib
import io
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

from buildarena_simworker.besiege.errors import DesktopError, NotSetUpError, ScreenError

HAND_OVER_S: Final = 2.0
"""Time limit for another program to transfer its copied text, seconds."""


TRIES: Final = 10
TRY_AGAIN_S: Final = 0.1
"""Pause before another try, seconds: on Windows one program at a time holds the clipboard."""


class _SystemClipboard:
    """Clipboard of Windows and macOS, whose text the system stores."""

    def __init__(self) -> None:
        import pyperclip

        self._clip: Any = pyperclip

    def put(self, text: str) -> None:
        self._reached(lambda: self._clip.copy(text))

    def get(self) -> str | None:
        return str(self._reached(self._clip.paste))

    def close(self) -> None:
        pass

    def _reached(self, act: Callable[[], Any]) -> Any:
        for left in reversed(range(TRIES)):
            try:
                return act()
            except (self._clip.PyperclipException, OSError) as error:
                if not left:
                    raise ScreenError(
                        f"the clipboard cannot be reached, as another program keeps it: {error}"
                    ) from error
                time.sleep(TRY_AGAIN_S)
        return None


class _X11Clipboard:
    """Clipboard of X11, whose text the copying program transfers while it lives and answers."""

    def __init__(self) -> None:
        program = shutil.which("xclip")
        if program is None:
            raise NotSetUpError("the clipboard needs the program xclip: install it")
        self._words = [program, "-selection", "clipboard"]
        self._owner: subprocess.Popen[bytes] | None = None

    def put(self, text: str) -> None:
        self.close()
        self._owner = subprocess.Popen(
            [*self._words, "-quiet", "-in"],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        assert self._owner.stdin is not None  # noqa: S101 - it was asked for
        try:
            self._owner.stdin.write(text.encode())
            self._owner.stdin.close()
        except OSError as error:
            raise ScreenError(f"the clipboard cannot be reached: {error}") from error

    def get(self) -> str | None:
        try:
            done = subprocess.run(
                [*self._words, "-out"], capture_output=True, timeout=HAND_OVER_S, check=False
            )
        except subprocess.TimeoutExpired:
            return None
        return done.stdout.decode("utf-8", "replace") if done.returncode == 0 else None

    def close(self) -> None:
        if self._owner is not None:
            self._owner.terminate()
            self._owner.wait()
            self._owner = None


MODIFIERS: Final = ("ctrl", "shift", "alt", "command", "win")
SELECT: Final = "ctrl"
"""Modifier key of "select all" and "copy"."""
KEY_S: Final = 0.05
"""Duration of a shortcut's key presses and pauses, seconds: three frames of a game."""
COPY_S: Final = 1.0
"""Time limit for a copy to reach the clipboard, seconds."""
SENTINEL: Final = "nothing was copied"
"""Text in the clipboard before copying: if it is still there, nothing was copied."""


class ScreenInput:
    """Mouse, keyboard and clipboard, used like a person does.

    Args:
        pace: Factor by which all waits are shorter than usual.

    Raises:
        NotSetUpError: There is no screen, or the extra `besiege` or a program is not installed.
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
                f"playing the game needs `pip install buildarena[besiege]` ({error})"
            ) from error
        except Exception as error:
            raise NotSetUpError(f"there is no screen to play on: {error}") from error
        pyautogui.PAUSE = 0.0
        self._gui: Any = pyautogui
        self._clipboard = _SystemClipboard() if sys.platform == "win32" else _X11Clipboard()

    def wait(self, seconds: float) -> None:
        """Wait as long as a game needs at the usual pace."""
        time.sleep(seconds / self._pace)

    def click(self, x: int, y: int) -> None:
        """Click slowly, because games miss fast clicks."""
        gui = self._gui
        with _stopped_by_hand(gui):
            gui.moveTo(x, y)
            self.wait(0.1)
            gui.mouseDown()
            self.wait(0.05)
            gui.mouseUp()

    def move(self, x: int, y: int) -> None:
        """Move the mouse."""
        with _stopped_by_hand(self._gui):
            self._gui.moveTo(x, y)

    def screen_size(self) -> tuple[int, int]:
        """Return the width and height of the screen, pixels."""
        size = self._gui.size()
        return (int(size.width), int(size.height))

    def position(self) -> tuple[int, int]:
        """Return the position of the mouse."""
        point = self._gui.position()
        return (int(point.x), int(point.y))

    def press(self, key: str) -> None:
        """Press and release one key."""
        with _stopped_by_hand(self._gui):
            self._gui.press(key)

    def hotkey(self, modifier: str, *keys: str) -> None:
        """Press keys, each for a moment, while a modifier is down; whatever happens, none stays.

        A game that looks at its keys once a frame misses those that go down and up in between.
        """
        with _stopped_by_hand(self._gui):
            try:
                self._gui.keyDown(modifier)
                for key in keys:
                    self.wait(KEY_S)
                    self._gui.keyDown(key)
                    self.wait(KEY_S)
                    self._gui.keyUp(key)
                self.wait(KEY_S)
            finally:
                for key in (*keys, modifier):
                    self._gui.keyUp(key)

    def write(self, text: str) -> None:
        """Type a text of letters and digits."""
        with _stopped_by_hand(self._gui):
            self._gui.write(text)

    def release_all(self) -> None:
        """Release all keys and buttons that a runner that died may have held."""
        with _stopped_by_hand(self._gui):
            for key in MODIFIERS:
                self._gui.keyUp(key)
            self._gui.mouseUp()

    def close(self) -> None:
        """Release keys and clipboard."""
        try:
            self.release_all()
        finally:
            self._clipboard.close()

    def clear_clipboard(self) -> None:
        """Mark the clipboard, so that a later copy can be recognised."""
        self._clipboard.put(SENTINEL)

    def copy_all(self) -> str | None:
        """Select and copy all text at the keyboard's focus; return None if nothing was copied.

        The copy follows the selection immediately: a text that grows at its top moves under the
        selection, and loses its end.
        """
        self.clear_clipboard()
        self.hotkey(SELECT, "a", "c")
        ends = time.monotonic() + COPY_S / self._pace
        while True:
            text = self._clipboard.get()
            if text is not None and text != SENTINEL:
                return text
            if time.monotonic() >= ends:
                return None
            self.wait(KEY_S)


def _need_no_authority() -> None:
    """Point Python's Xlib to an empty authority file, required even if the screen needs none."""
    if sys.platform == "win32" or "XAUTHORITY" in os.environ:
        return
    if not Path("~/.Xauthority").expanduser().exists():
        os.environ["XAUTHORITY"] = os.devnull


@contextlib.contextmanager
def _stopped_by_hand(gui: Any) -> Iterator[None]:
    """Turn what PyAutoGUI raises into our own errors.

    Its fail-safe is the mouse in the screen's corner; everything else is a screen that does not
    take what is pressed, as while it is locked.
    """
    try:
        yield
    except DesktopError:
        raise
    except gui.FailSafeException as error:
        raise DesktopError("somebody moved the mouse into the screen's corner to stop") from error
    except Exception as error:
        detail = str(error) or type(error).__name__
        raise ScreenError(f"mouse and keyboard cannot be used: {detail}") from error
