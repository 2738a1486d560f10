"""Finding a window by its title and bringing it to the front, on Windows, macOS and X11."""

from __future__ import annotations

import contextlib
import io
import subprocess
import sys
from dataclasses import dataclass
from typing import Any, Protocol


@dataclass(frozen=True, slots=True)
class Area:
    """A rectangle of the screen, pixels from its upper left corner."""

    left: int
    top: int
    width: int
    height: int

    @property
    def box(self) -> tuple[int, int, int, int]:
        """Left, upper, right and lower edge."""
        return (self.left, self.top, self.left + self.width, self.top + self.height)


class Windows(Protocol):
    """The windows of a screen."""

    def find(self, title: str) -> Area | None:
        """Where the window is whose title contains this, whatever the case; None without one."""

    def raise_(self, title: str) -> None:
        """Brings it to the front and gives it the keyboard."""

    def is_active(self, title: str) -> bool:
        """Whether it has the keyboard."""


def open_windows() -> Windows:
    """The windows of this machine's screen."""
    if sys.platform in {"win32", "cygwin"}:
        return _WindowsWindows()
    if sys.platform == "darwin":
        return _MacWindows()
    return _X11Windows()


class _WindowsWindows:
    """Through PyGetWindow, which PyAutoGUI brings along."""

    def find(self, title: str) -> Area | None:
        window = self._window(title)
        if window is None or window.isMinimized:
            return None
        return Area(window.left, window.top, window.width, window.height)

    def raise_(self, title: str) -> None:
        window = self._window(title)
        if window is not None:
            if window.isMinimized:
                window.restore()
            window.activate()

    def is_active(self, title: str) -> bool:
        window = self._window(title)
        return window is not None and bool(window.isActive)

    def _window(self, title: str) -> Any:
        import pygetwindow

        matches = pygetwindow.getWindowsWithTitle(title)
        return matches[0] if matches else None


class _MacWindows:
    """Through System Events; the terminal needs the right to control the computer."""

    def find(self, title: str) -> Area | None:
        script = f"{_mac_process(title)} to get {{position, size}} of (first window of it)"
        text = _osascript(script)
        parts = [part.strip() for part in text.replace("{", "").replace("}", "").split(",")]
        if len(parts) != 4:  # noqa: PLR2004 - position and size
            return None
        return Area(*(int(part) for part in parts))

    def raise_(self, title: str) -> None:
        _osascript(f"{_mac_process(title)} to set frontmost to true")

    def is_active(self, title: str) -> bool:
        return _osascript(f"{_mac_process(title)} to get frontmost") == "true"


def _mac_process(title: str) -> str:
    name = "".join(letter for letter in title if letter.isalnum() or letter in " -()")
    return f'tell application "System Events" to tell (first process whose name contains "{name}")'


def _osascript(script: str) -> str:
    done = subprocess.run(
        ["/usr/bin/osascript", "-e", script], capture_output=True, text=True, timeout=5, check=False
    )
    return done.stdout.strip()


class _X11Windows:
    """Through Xlib, which PyAutoGUI brings along; works with and without a window manager."""

    def __init__(self) -> None:
        from Xlib import display

        # Xlib prints what it misses to standard output, which is for results.
        with contextlib.redirect_stdout(io.StringIO()):
            self._display = display.Display()
        self._root = self._display.screen().root

    def find(self, title: str) -> Area | None:
        window = self._window(title)
        if window is None:
            return None
        return self._area(window)

    def raise_(self, title: str) -> None:
        from Xlib import X
        from Xlib.protocol import event

        window = self._window(title)
        if window is None:
            return
        active = self._display.intern_atom("_NET_ACTIVE_WINDOW")
        window.configure(stack_mode=X.Above)
        # A window manager that knows the message does the rest; without one this does it.
        message = event.ClientMessage(
            window=window, client_type=active, data=(32, [2, X.CurrentTime, 0, 0, 0])
        )
        mask = X.SubstructureRedirectMask | X.SubstructureNotifyMask
        self._root.send_event(message, event_mask=mask)
        window.set_input_focus(X.RevertToParent, X.CurrentTime)
        self._display.sync()

    def is_active(self, title: str) -> bool:
        wanted = self._window(title)
        focus = self._display.get_input_focus().focus
        while wanted is not None and not isinstance(focus, int):
            if focus.id == wanted.id:
                return True
            parent = focus.query_tree().parent
            if isinstance(parent, int) or parent is None:
                return False
            focus = parent
        return False

    def _window(self, title: str) -> Any:
        """The topmost shown window of this title."""
        waiting = [self._root]
        match = None
        while waiting:
            window = waiting.pop(0)
            try:
                children = window.query_tree().children
                if title.casefold() in self._name(window) and self._is_shown(window):
                    match = window
            except self._gone():
                continue
            waiting += children
        return match

    def _name(self, window: Any) -> str:
        for atom in ("_NET_WM_NAME", "WM_NAME"):
            name_property = window.get_full_property(self._display.intern_atom(atom), 0)
            if name_property is not None and name_property.value:
                value = name_property.value
                text = value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)
                return text.casefold()
        return ""

    def _is_shown(self, window: Any) -> bool:
        from Xlib import X

        return bool(window.get_attributes().map_state == X.IsViewable)

    def _area(self, window: Any) -> Area | None:
        try:
            size = window.get_geometry()
            corner = self._root.translate_coords(window, 0, 0)
        except self._gone():
            return None
        return Area(corner.x, corner.y, size.width, size.height)

    @staticmethod
    def _gone() -> tuple[type[Exception], ...]:
        from Xlib import error

        return (error.BadWindow, error.BadDrawable)
