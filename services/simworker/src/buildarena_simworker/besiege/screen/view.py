"""Content of a game's window, and positions of its items on the screen."""

from __future__ import annotations

from typing import Final

from PIL.Image import Image

from buildarena_simworker.besiege.errors import GameGoneError
from buildarena_simworker.besiege.screen.calibration import Calibration
from buildarena_simworker.besiege.screen.capture import difference, is_black, picture
from buildarena_simworker.besiege.screen.window_types import Area, Windows

CHANGED: Final = 0.02
"""Share of a patch that changes when something is opened or closed there."""
PATCH: Final = (0.14, 0.10)
"""Width and height of a patch, shares of the window."""


class View:
    """Window of one game.

    Args:
        calibration: Positions of its items.
        windows: Finder of the window.
    """

    def __init__(self, calibration: Calibration, windows: Windows) -> None:
        self._calibration = calibration
        self._windows = windows

    def point(self, place: str) -> tuple[int, int]:
        """Return the position of an item on the screen, pixels.

        Raises:
            GameGoneError: The window is missing.
        """
        window = self._window()
        pixels = self._calibration.pixels.get(place)
        if pixels is not None:
            return (window.left + pixels[0], window.top + pixels[1])
        return self.at(*self._calibration.positions[place])

    def at(self, x: float, y: float) -> tuple[int, int]:
        """Convert fractions of the window to a position on the screen, pixels."""
        window = self._window()
        return (window.left + round(x * window.width), window.top + round(y * window.height))

    def patch(self, place: str) -> Image:
        """Return the window's picture around an item."""
        window = self._window()
        width, height = round(PATCH[0] * window.width), round(PATCH[1] * window.height)
        x, y = self.point(place)
        left = min(max(x - width // 2, window.left), window.left + window.width - width)
        top = min(max(y - height // 2, window.top), window.top + window.height - height)
        return picture(Area(left, top, width, height))

    def differs(self, place: str, before: Image) -> bool:
        """Check if the window now looks different there."""
        return difference(self.patch(place), before) > CHANGED

    def whole(self) -> Image:
        """Return the picture of the whole window."""
        return picture(self._window())

    def size_finding(self) -> str | None:
        """Return the fault of the window's size; None if it is as calibrated, and shows much."""
        window = self._window()
        size, usual = (window.width, window.height), self._calibration.window
        if usual is not None and size != usual:
            return f"the window is {size[0]}x{size[1]}, and was calibrated at {usual[0]}x{usual[1]}"
        if is_black(self.whole()):
            return "the window is black, as while the screen is locked or asleep"
        return None

    def _window(self) -> Area:
        window = self._windows.find()
        if window is None:
            raise GameGoneError(f"there is no {self._windows.identity}")
        return window
