"""Where to click: positions in the game's window, as fractions of its width and height.

Source of the default positions: the published runner's, which are fractions of a whole screen; on
any other machine they are a first guess, and `buildarena besiege calibrate` finds the right ones.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Final

from buildarena_simworker.besiege.errors import NotSetUpError
from buildarena_simworker.besiege.whole_files import write_whole

CALIBRATION_VERSION: Final = 2
MAX_WAIT_S: Final = 600.0
POSITIONS: Final = MappingProxyType(
    {
        "open_folder": ((0.202, 0.035), "the button that opens the list of machine files"),
        "name_box": ((0.476, 0.215), "the box into which a machine's name is typed"),
        "open_machine": ((0.638, 0.209), "the button that loads the machine of that name"),
        "set_ground": ((0.403, 0.0185), 'the button "set ground"'),
        "empty_space": ((0.034, 0.726), "a place where nothing is, clear of the machine"),
        "start": ((0.021, 0.016), "the button that starts and stops the simulation"),
        "delete": ((0.707, 0.038), "the button that deletes the machine"),
        "confirm": ((0.538, 0.586), "the button that confirms the deletion"),
    }
)
"""Default position and description of everything that is clicked, in the order of asking."""

PIXELS: Final = MappingProxyType(
    {
        "lua_panel": ((106, 197), "the middle of the Lua panel"),
        "log_window": ((524, 133), "the newest line of the Lua panel's log"),
    }
)
"""Default position and description of what the mod draws, pixels from the window's upper left
corner whatever its size. Source: the mod's public code; its log begins at (284, 124), and is as
high as its lines, so that only its first line is always there."""


@dataclass(frozen=True, slots=True)
class PathClick:
    """One click of the way from the game's title to the level.

    Attributes:
        x: Fraction of the window's width.
        y: Fraction of its height.
        wait_s: How long the game needs before it can be clicked, seconds.
    """

    x: float
    y: float
    wait_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """What a person found out about a game's window.

    Attributes:
        positions: (x, y) of each place of `POSITIONS`, fractions of the window.
        pixels: (x, y) of each place of `PIXELS`, pixels from the window's corner.
        window: (width, height) of the window when it was made, pixels; None for the defaults.
        screen: (width, height) of what the game said then that it draws; None before it did.
        installed: What was installed when it was tried: the game's build, the mod's version.
        path: The way from the game's title to the level, for a game that was restarted.
    """

    positions: dict[str, tuple[float, float]] = field(
        default_factory=lambda: {name: place for name, (place, _) in POSITIONS.items()}
    )
    pixels: dict[str, tuple[int, int]] = field(
        default_factory=lambda: {name: place for name, (place, _) in PIXELS.items()}
    )
    window: tuple[int, int] | None = None
    screen: tuple[int, int] | None = None
    installed: dict[str, str] = field(default_factory=dict)
    path: tuple[PathClick, ...] = ()

    @property
    def digest(self) -> str:
        """A short hash of everything in it, for manifests."""
        text = json.dumps(asdict(self), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:12]

    def save(self, file: Path) -> None:
        """Writes it whole or not at all."""
        content = {"version": CALIBRATION_VERSION, **asdict(self)}
        write_whole(file, (json.dumps(content, indent=2) + "\n").encode())


def load_calibration(file: Path) -> Calibration:
    """The calibration of a file.

    Raises:
        NotSetUpError: There is none, or it is not one.
    """
    advice = "run `buildarena besiege calibrate`"
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise NotSetUpError(f"there is no calibration {file}: {advice}") from error
    except (OSError, ValueError) as error:
        raise NotSetUpError(f"{file} cannot be read ({error}): {advice}") from error
    if not isinstance(content, dict) or content.get("version") != CALIBRATION_VERSION:
        raise NotSetUpError(f"{file} is no calibration of this version: {advice}")
    places = content.get("positions")
    if not isinstance(places, dict) or set(places) != set(POSITIONS):
        wanted = ", ".join(POSITIONS)
        raise NotSetUpError(f"{file}: positions must name just {wanted}: {advice}")
    pixels, recorded = content.get("pixels"), content.get("installed")
    if not isinstance(pixels, dict) or set(pixels) != set(PIXELS):
        raise NotSetUpError(f"{file}: pixels must name just {', '.join(PIXELS)}: {advice}")
    return Calibration(
        positions={name: _position(file, name, places[name]) for name in POSITIONS},
        pixels={name: _pixel(file, name, pixels[name]) for name in PIXELS},
        window=_size(content.get("window")),
        screen=_size(content.get("screen")),
        installed=dict(recorded) if isinstance(recorded, dict) else {},
        path=_path(file, content.get("path", [])),
    )


def _path(file: Path, value: object) -> tuple[PathClick, ...]:
    clicks = [_click(entry) for entry in value] if isinstance(value, list) else [None]
    whole = tuple(click for click in clicks if click is not None)
    if len(whole) != len(clicks):
        raise NotSetUpError(
            f"{file}: path is no list of clicks with x, y and wait_s: "
            "run `buildarena besiege calibrate --path`"
        )
    return whole


def _click(value: object) -> PathClick | None:
    names = ("x", "y", "wait_s")
    if not isinstance(value, dict) or set(value) != set(names):
        return None
    if not all(isinstance(value[name], int | float) for name in names):
        return None
    x, y, wait_s = (float(value[name]) for name in names)
    sound = 0 <= x <= 1 and 0 <= y <= 1 and 0 <= wait_s <= MAX_WAIT_S
    return PathClick(x=x, y=y, wait_s=wait_s) if sound else None


def _position(file: Path, name: str, value: object) -> tuple[float, float]:
    if (
        isinstance(value, list)
        and len(value) == 2  # noqa: PLR2004 - x and y
        and all(isinstance(part, int | float) and 0 <= part <= 1 for part in value)
    ):
        return (float(value[0]), float(value[1]))
    raise NotSetUpError(
        f"{file}: position {name} is {value!r}, not two fractions of the window from 0 to 1: "
        "run `buildarena besiege calibrate`"
    )


def _pixel(file: Path, name: str, value: object) -> tuple[int, int]:
    size = _size(value)
    if size is None or min(size) < 0:
        raise NotSetUpError(
            f"{file}: pixel {name} is {value!r}, not two whole numbers: "
            "run `buildarena besiege calibrate`"
        )
    return size


def _size(value: object) -> tuple[int, int] | None:
    if (
        isinstance(value, list)
        and len(value) == 2  # noqa: PLR2004 - width and height
        and all(isinstance(part, int) and not isinstance(part, bool) for part in value)
    ):
        return (value[0], value[1])
    return None
