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

from buildarena_simworker_besiege.errors import NotSetUpError
from buildarena_simworker_besiege.whole_files import write_whole

CALIBRATION_VERSION: Final = 1
POSITIONS: Final = MappingProxyType(
    {
        "open_folder": ((0.202, 0.035), "the button that opens the list of machine files"),
        "name_box": ((0.476, 0.215), "the box into which a machine's name is typed"),
        "open_machine": ((0.638, 0.209), "the button that loads the machine of that name"),
        "set_ground": ((0.403, 0.0185), 'the button "set ground"'),
        "log_window": ((0.185, 0.172), "the middle of the Lua panel's log (Ctrl+L shows it)"),
        "empty_space": ((0.034, 0.726), "a place where nothing is, clear of the machine"),
        "start": ((0.021, 0.016), "the button that starts and stops the simulation"),
        "delete": ((0.707, 0.038), "the button that deletes the machine"),
        "confirm": ((0.538, 0.586), "the button that confirms the deletion"),
    }
)
"""Default position and description of everything that is clicked, in the order of asking."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """What a person found out about a game's window.

    Attributes:
        positions: (x, y) of each place of `POSITIONS`, fractions of the window.
        window: (width, height) of the window when it was made, pixels; None for the defaults.
    """

    positions: dict[str, tuple[float, float]] = field(
        default_factory=lambda: {name: place for name, (place, _) in POSITIONS.items()}
    )
    window: tuple[int, int] | None = None

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
    return Calibration(
        positions={name: _position(file, name, places[name]) for name in POSITIONS},
        window=_window(content.get("window")),
    )


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


def _window(value: object) -> tuple[int, int] | None:
    if isinstance(value, list) and len(value) == 2:  # noqa: PLR2004 - width and height
        return (int(value[0]), int(value[1]))
    return None
