"""Content of a game's window, and positions of its items on the screen."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Final

from buildarena_simworker.besiege.errors import GameGoneError, ScreenError
from buildarena_simworker.besiege.screen.calibration import Calibration
from buildarena_simworker.besiege.screen.windows import Area, Windows

if TYPE_CHECKING:
    from PIL.Image import Image

CHANGED: Final = 0.02
"""Share of a patch that changes when something is opened or closed there."""
PATCH: Final = (0.14, 0.10)
"""Width and height of a patch, shares of the window."""
_VISIBLE: Final = 16
"""Minimum change of a pixel that counts, in shades of grey of 256."""


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


def picture(area: Area) -> Image:
    """Return a part of the screen, in shades of grey."""
    return _grabbed(area.box).convert("L")


def screenshot() -> bytes:
    """Return the whole screen as PNG; raise `ScreenError` if there is none."""
    data = io.BytesIO()
    _grabbed(None).save(data, "PNG")
    return data.getvalue()


def is_black(image: Image) -> bool:
    """Check if nothing is visible, as while the screen is locked or asleep."""
    return not any(image.convert("L").histogram()[_VISIBLE:])


def _grabbed(box: tuple[int, int, int, int] | None) -> Image:
    """Return the screen, or a part of it.

    Raises:
        ScreenError: The system returns no picture, as while the screen is locked.
    """
    from PIL import ImageGrab

    try:
        return ImageGrab.grab(bbox=box)
    except OSError as error:
        raise ScreenError(f"the screen shows nothing, as while it is locked: {error}") from error


def difference(first: Image, second: Image) -> float:
    """Return the share of two pictures that looks different, 0 to 1."""
    from PIL import ImageChops

    if first.size != second.size:
        return 1.0
    small = (256, 256)
    changed = ImageChops.difference(first.resize(small), second.resize(small))
    counts = changed.histogram()
    return sum(counts[_VISIBLE:]) / (small[0] * small[1])
