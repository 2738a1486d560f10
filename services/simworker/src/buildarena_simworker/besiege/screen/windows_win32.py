"""The game's window on Windows, by the functions of the system itself."""

from __future__ import annotations

import ctypes
from ctypes import wintypes
from typing import Any, Final

from buildarena_simworker.besiege.screen.windows import Area, WindowIdentity

LONGEST_TITLE: Final = 512
RESTORE: Final = 9
ALT: Final = 0x12
KEY_UP: Final = 2

_CALLBACK: Any = getattr(ctypes, "WINFUNCTYPE", ctypes.CFUNCTYPE)(
    wintypes.BOOL, wintypes.HWND, wintypes.LPARAM
)


class Win32Windows:
    """The topmost window of the game.

    Args:
        identity: Identification of the window.
        user32: System library for windows. Defaults to this machine's.
    """

    def __init__(self, identity: WindowIdentity, user32: Any = None) -> None:
        self.identity = identity
        self._user: Any = user32 or getattr(ctypes, "windll").user32  # noqa: B009 - Windows only

    def find(self) -> Area | None:
        """Return the game's drawing area, without frame and title bar; None while minimised."""
        window = self._window()
        if window is None or self._user.IsIconic(window):
            return None
        inside, corner = wintypes.RECT(), wintypes.POINT(0, 0)
        measured = self._user.GetClientRect(window, ctypes.byref(inside))
        if not measured or not self._user.ClientToScreen(window, ctypes.byref(corner)):
            return None
        return Area(corner.x, corner.y, inside.right - inside.left, inside.bottom - inside.top)

    def raise_(self) -> None:
        """Bring it to the front.

        The system allows a program to do that only right after a key press: a press of Alt, which
        has no visible effect, follows if the first try failed.
        """
        window = self._window()
        if window is None:
            return
        if self._user.IsIconic(window):
            self._user.ShowWindow(window, RESTORE)
        if not self._user.SetForegroundWindow(window):
            self._user.keybd_event(ALT, 0, 0, 0)
            self._user.keybd_event(ALT, 0, KEY_UP, 0)
            self._user.SetForegroundWindow(window)

    def is_active(self) -> bool:
        """Check if it has the keyboard."""
        window = self._window()
        return window is not None and self._user.GetForegroundWindow() == window

    def process(self) -> int | None:
        """Return the id of its process."""
        window = self._window()
        return None if window is None else self._process_of(window)

    def _window(self) -> int | None:
        """Return the windows are gone through from the uppermost one down."""
        matches: list[int] = []

        def look(window: int, _: int) -> bool:
            if (
                self._user.IsWindowVisible(window)
                and self.identity.has_title(self._title(window))
                and self.identity.has_program(self._process_of(window))
            ):
                matches.append(window)
            return not matches

        self._user.EnumWindows(_CALLBACK(look), 0)
        return matches[0] if matches else None

    def _title(self, window: int) -> str:
        text = ctypes.create_unicode_buffer(LONGEST_TITLE)
        self._user.GetWindowTextW(window, text, LONGEST_TITLE)
        return text.value

    def _process_of(self, window: int) -> int | None:
        number = wintypes.DWORD(0)
        self._user.GetWindowThreadProcessId(window, ctypes.byref(number))
        return int(number.value) or None
