"""What the game's window is known by, and what a screen is asked of it."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import Protocol

import psutil

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
class Wanted:
    """What the game's window is known by.

    Attributes:
        title: Its title, whatever the case; a page about the game has a longer one.
        executable: Its program, whatever the case and ending; "" for any.
    """

    title: str
    executable: str = ""

    def has_title(self, title: str) -> bool:
        """Whether a window's title is the game's."""
        return title.strip().casefold() == self.title.strip().casefold()

    def has_program(self, pid: int | None) -> bool:
        """Whether a window's process runs the game's program; one that is not told may."""
        if not self.executable or pid is None:
            return True
        with suppress(psutil.Error):
            name = psutil.Process(pid).name()
            return executable_stem(name) == executable_stem(self.executable)
        return True

    def __str__(self) -> str:
        """The two, for messages."""
        program = f" of the program {self.executable!r}" if self.executable else ""
        return f"window titled {self.title!r}{program}"


class Windows(Protocol):
    """The game's window among a screen's.

    Each call finds it anew, and raises `ScreenError` where the screen itself does not answer.
    """

    @property
    def wanted(self) -> Wanted:
        """What it is known by."""

    def find(self) -> Area | None:
        """What the game draws to, without the window's frame; None while it is not shown."""

    def raise_(self) -> None:
        """Brings it to the front and gives it the keyboard."""

    def is_active(self) -> bool:
        """Whether it has the keyboard."""

    def process(self) -> int | None:
        """The number of its process; None without a window, or where the screen does not say."""
