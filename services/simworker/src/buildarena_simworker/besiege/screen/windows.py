"""The game's window: found by its exact title and its program, on Windows, macOS and X11."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import Protocol

import psutil

from buildarena_simworker.besiege.errors import NotSetUpError
from buildarena_simworker.besiege.process import executable_stem


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


@dataclass(frozen=True, slots=True, kw_only=True)
class WindowIdentity:
    """Identification of the game's window.

    Attributes:
        title: Title, ignoring case; a page about the game has a longer one.
        executable: Program, ignoring case and extension; "" for any.
    """

    title: str
    executable: str = ""

    def has_title(self, title: str) -> bool:
        """Check if a window's title is the game's."""
        return title.strip().casefold() == self.title.strip().casefold()

    def has_program(self, pid: int | None) -> bool:
        """Check if a window's process may run the game's program; an unknown one may."""
        if not self.executable or pid is None:
            return True
        with suppress(psutil.Error):
            name = psutil.Process(pid).name()
            return executable_stem(name) == executable_stem(self.executable)
        return True

    def __str__(self) -> str:
        """Format both for messages."""
        program = f" of the program {self.executable!r}" if self.executable else ""
        return f"window titled {self.title!r}{program}"


class Windows(Protocol):
    """The game's window on a screen.

    Each call finds it again, and raises `ScreenError` if the screen itself does not answer.

    Attributes:
        identity: Identification of the window.
    """

    identity: WindowIdentity

    def find(self) -> Area | None:
        """Return the game's drawing area, without the window's frame; None while it is hidden."""

    def raise_(self) -> None:
        """Bring it to the front and give it the keyboard."""

    def is_active(self) -> bool:
        """Check if it has the keyboard."""

    def process(self) -> int | None:
        """Return the id of its process; None without a window, or if the screen lacks it."""


def find_window(windows: Windows) -> Area:
    """Return the game's drawing area.

    Raises:
        NotSetUpError: The window is missing.
    """
    window = windows.find()
    if window is None:
        raise NotSetUpError(
            f"there is no {windows.identity}: start the game, or correct BUILDARENA_BESIEGE_TITLE "
            "and BUILDARENA_BESIEGE_EXECUTABLE"
        )
    return window
