"""The game's window on Windows, by the functions of the system itself."""

from __future__ import annotations

import ctypes
from ctypes import wintypes
from typing import Any, Final

from buildarena_simworker.besiege.screen.window_types import Area, Wanted

LONGEST_TITLE: Final = 512
RESTORE: Final = 9
ALT: Final = 0x12
KEY_UP: Final = 2

_CALLBACK: Any = getattr(ctypes, "WINFUNCTYPE", ctypes.CFUNCTYPE)(
    wintypes.BOOL, wintypes.HWND, wintypes.LPARAM
)


class Win32Windows:
    """The topmost window that is the game's.

    Args:
        wanted: What it is known by.
        user32: The system's library of windows; this machine's if left out.
    """

    def __init__(self, wanted: Wanted, user32: Any = None) -> None:
        self.wanted = wanted
        self._user: Any = user32 or getattr(ctypes, "windll").user32  # noqa: B009 - Windows only

    def find(self) -> Area | None:
        """What the game draws to, without frame and title bar; None while it is minimised."""
        window = self._window()
        if window is None or self._user.IsIconic(window):
            return None
        inside, corner = wintypes.RECT(), wintypes.POINT(0, 0)
        measured = self._user.GetClientRect(window, ctypes.byref(inside))
        if not measured or not self._user.ClientToScreen(window, ctypes.byref(corner)):
            return None
        return Area(corner.x, corner.y, inside.right - inside.left, inside.bottom - inside.top)

    def raise_(self) -> None:
        """Brings it to the front.

        The system lets a program do that only right after a key: a press of Alt that nobody
        notices counts, and is made where the first try did nothing.
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
        """Whether it has the keyboard."""
        window = self._window()
        return window is not None and self._user.GetForegroundWindow() == window

    def process(self) -> int | None:
        """The number of its process."""
        window = self._window()
        return None if window is None else self._process_of(window)

    def _window(self) -> int | None:
        """Windows are gone through from the uppermost one down."""
        matches: list[int] = []

        def look(window: int, _: int) -> bool:
            if (
                self._user.IsWindowVisible(window)
                and self.wanted.has_title(self._title(window))
                and self.wanted.has_program(self._process_of(window))
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
