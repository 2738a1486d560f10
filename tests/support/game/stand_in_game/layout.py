"""Where everything is in the window, in fractions of its width and height."""

from dataclasses import dataclass
from typing import Final

from support.game.stand_in_game.game import SIZE


@dataclass(frozen=True, slots=True)
class Box:
    """A rectangle: left, top, right, bottom."""

    left: float
    top: float
    right: float
    bottom: float

    def holds(self, x: float, y: float) -> bool:
        """Whether a point lies in it."""
        return self.left <= x < self.right and self.top <= y < self.bottom


def around(x: float, y: float, width: float, height: float) -> Box:
    """The box of a size with its middle at a point."""
    return Box(x - width / 2, y - height / 2, x + width / 2, y + height / 2)


# The middles are what the published runner clicks at.
TOOLBAR: Final = {"start": around(0.021, 0.016, 0.036, 0.030)}
TOOLBAR["open_folder"] = around(0.202, 0.035, 0.034, 0.040)
TOOLBAR["set_ground"] = around(0.403, 0.0185, 0.060, 0.032)
TOOLBAR["delete"] = around(0.707, 0.038, 0.034, 0.040)
LOAD_PANEL: Final = Box(0.370, 0.120, 0.700, 0.420)
LOAD_ITEMS: Final = {"name_box": around(0.476, 0.215, 0.190, 0.040)}
LOAD_ITEMS["open_machine"] = around(0.638, 0.209, 0.090, 0.046)
TITLE_ITEMS: Final = {"to_levels": around(0.500, 0.550, 0.200, 0.080)}
LEVELS_ITEMS: Final = {"to_level": around(0.800, 0.450, 0.160, 0.200)}
CONFIRM_PANEL: Final = Box(0.380, 0.420, 0.640, 0.640)
CONFIRM_ITEMS: Final = {"confirm": around(0.538, 0.586, 0.080, 0.050)}
DIALOG_PANEL: Final = Box(0.300, 0.300, 0.700, 0.600)
DIALOG_ITEMS: Final = {"dialog_ok": around(0.500, 0.540, 0.080, 0.050)}


LINE_HEIGHT: Final = 18
"""Of a line in the log, pixels."""


def _pixels(left: float, top: float, right: float, bottom: float) -> Box:
    return Box(left / SIZE[0], top / SIZE[1], right / SIZE[0], bottom / SIZE[1])


LUA_PANEL: Final = _pixels(6, 70, 206, 324)
"""The mod's panel, which Ctrl+L shows and hides."""
LOG_PANEL: Final = _pixels(274, 70, 774, 670)
"""The mod's log, drawn beside the panel once something was printed."""


def log_text(lines: int) -> Box:
    """The text in the log: as high as its lines, as far as they are seen."""
    return _pixels(284, 124, 764, 124 + min(lines * LINE_HEIGHT, 536))
