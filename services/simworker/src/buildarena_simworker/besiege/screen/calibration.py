"""Positions of clicks in the game's window, as fractions of its width and height.

Source of the default positions: the published runner's, which are fractions of a whole screen; on
any other machine they are a first guess, and `buildarena besiege calibrate` finds the right ones.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Collection
from dataclasses import asdict, field
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Final, TypeVar

from pydantic import AfterValidator, Field, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass

from buildarena_simworker.besiege.errors import NotSetUpError
from buildarena_simworker.besiege.traces import write_whole

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
"""Default position and description of every item to click, in the order of the questions."""

PIXELS: Final = MappingProxyType(
    {
        "lua_panel": ((106, 197), "the middle of the Lua panel"),
        "log_window": ((524, 133), "the newest line of the Lua panel's log"),
    }
)
"""Default position and description of the mod's items, pixels from the window's upper left
corner at any size. Source: the mod's public code; its log begins at (284, 124), and is as
high as its lines, so that only its first line is always there."""

Fraction = Annotated[float, Field(ge=0, le=1)]
Pixels = Annotated[int, Field(ge=0, strict=True)]
Places = TypeVar("Places", bound=Collection[str])


def _just(names: Collection[str]) -> AfterValidator:
    """Refuse what does not name all of some places and no other."""

    def check(places: Places) -> Places:
        if set(places) != set(names):
            raise ValueError(f"it must name just {', '.join(names)}")
        return places

    return AfterValidator(check)


@dataclass(frozen=True, slots=True)
class PathClick:
    """A click on the path from the game's title to the level.

    Attributes:
        x: Fraction of the window's width.
        y: Fraction of its height.
        wait_s: Time that the game needs before it can be clicked, seconds.
    """

    x: Fraction
    y: Fraction
    wait_s: Annotated[float, Field(ge=0, le=MAX_WAIT_S)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """Measurements of a game's window by a person.

    Attributes:
        positions: (x, y) of each item of `POSITIONS`, fractions of the window.
        pixels: (x, y) of each item of `PIXELS`, pixels from the window's corner.
        window: (width, height) of the window when it was made, pixels; None for the defaults.
        screen: (width, height) of the game's picture as it reported then, pixels; None before that.
        installed: Versions when it was tested: the game's build, the mod's version.
        path: Clicks from the game's title to the level, for a restarted game.
    """

    positions: Annotated[dict[str, tuple[Fraction, Fraction]], _just(POSITIONS)] = field(
        default_factory=lambda: {name: place for name, (place, _) in POSITIONS.items()}
    )
    pixels: Annotated[dict[str, tuple[Pixels, Pixels]], _just(PIXELS)] = field(
        default_factory=lambda: {name: place for name, (place, _) in PIXELS.items()}
    )
    window: tuple[Pixels, Pixels] | None = None
    screen: tuple[Pixels, Pixels] | None = None
    installed: dict[str, str] = field(default_factory=dict)
    path: tuple[PathClick, ...] = ()

    @property
    def digest(self) -> str:
        """A short hash of everything in it, for manifests."""
        text = json.dumps(asdict(self), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:12]

    def save(self, file: Path) -> None:
        """Write it atomically."""
        content = {"version": CALIBRATION_VERSION, **asdict(self)}
        write_whole(file, (json.dumps(content, indent=2) + "\n").encode())


def load_calibration(file: Path) -> Calibration:
    """Return the calibration of a file.

    Raises:
        NotSetUpError: The file is missing or invalid.
    """
    advice = "run `buildarena besiege calibrate`"
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise NotSetUpError(f"there is no calibration {file}: {advice}") from error
    except (OSError, ValueError) as error:
        raise NotSetUpError(f"{file} cannot be read ({error}): {advice}") from error
    if not isinstance(content, dict) or content.get("version") != CALIBRATION_VERSION:
        raise NotSetUpError(f"{file} is not a calibration of this version: {advice}")
    fields = {**dict.fromkeys(("positions", "pixels")), **content}
    del fields["version"]
    try:
        return TypeAdapter(Calibration).validate_python(fields)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"]))
        path = " --path" * (first["loc"][0] == "path")
        problem = f"{file}: {where}: {first['msg']}, got {first['input']!r}"
        raise NotSetUpError(f"{problem}: run `buildarena besiege calibrate{path}`") from error
