"""What a game's window shows, and where its places are on the screen."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from buildarena_simworker_besiege.errors import GameGoneError
from buildarena_simworker_besiege.screen.calibration import Calibration
from buildarena_simworker_besiege.screen.capture import difference, picture
from buildarena_simworker_besiege.screen.windows import Area, Windows

if TYPE_CHECKING:
    from PIL.Image import Image

CHANGED: Final = 0.02
"""Share of a patch that looks different after something was opened or closed there."""
PATCH: Final = (0.14, 0.10)
"""Width and height of a patch, shares of the window."""


class View:
    """The window of one game.

    Args:
        title: Part of its title.
        calibration: Where its places are.
        windows: The screen's windows.
    """

    def __init__(self, title: str, calibration: Calibration, windows: Windows) -> None:
        self._title = title
        self._places = calibration.positions
        self._windows = windows

    def point(self, place: str) -> tuple[int, int]:
        """Where a place is on the screen, pixels.

        Raises:
            GameGoneError: There is no window.
        """
        window = self._window()
        x, y = self._places[place]
        return (window.left + round(x * window.width), window.top + round(y * window.height))

    def patch(self, place: str) -> Image:
        """What the window shows around a place."""
        window = self._window()
        width, height = round(PATCH[0] * window.width), round(PATCH[1] * window.height)
        x, y = self.point(place)
        left = min(max(x - width // 2, window.left), window.left + window.width - width)
        top = min(max(y - height // 2, window.top), window.top + window.height - height)
        return picture(Area(left, top, width, height))

    def differs(self, place: str, before: Image) -> bool:
        """Whether the window looks different there now."""
        return difference(self.patch(place), before) > CHANGED

    def whole(self) -> Image:
        """All that the window shows."""
        return picture(self._window())

    def _window(self) -> Area:
        window = self._windows.find(self._title)
        if window is None:
            raise GameGoneError(f"there is no window with {self._title!r} in its title")
        return window
