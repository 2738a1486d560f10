"""Settings of the game on a runner's machine, read from ``BUILDARENA_BESIEGE_*``."""

from __future__ import annotations

import hashlib
import shlex
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

from pydantic import Field
from pydantic_settings import BaseSettings, SettingsConfigDict


@dataclass(frozen=True, slots=True, kw_only=True)
class TimeLimits:
    """Limits by the wall clock, seconds.

    Attributes:
        start_s: Until a game that was started has its window, or its menu.
        effect_s: Until a click shows its effect.
        load_s: Until a machine is loaded.
        begin_s: Until the first line of a run, after the start.
        stall_s: Without anything new while a machine runs.
    """

    start_s: float = 240.0
    effect_s: float = 6.0
    load_s: float = 30.0
    begin_s: float = 15.0
    stall_s: float = 15.0


LEVEL_FIELD = "{level}"
"""Placeholder in the game's command: the level file to open, or "" for the sandbox."""


class BesiegeSettings(BaseSettings):
    """Settings by the owner of a machine with the game."""

    model_config = SettingsConfigDict(env_prefix="BUILDARENA_BESIEGE_", extra="ignore")

    game: str = ""
    """Version of the game, for example 1.75-23370."""
    mod: str = ""
    """Version of its Lua Scripting Mod."""
    folder: Path | None = None
    """Folder of the game."""
    machines: Path | None = None
    """Folder of machine files; default FOLDER/SavedMachines."""
    command: str = ""
    """Command that starts the game, so that the runner can restart it; {level} in it is replaced by
    the level file to open."""
    level: str = ""
    """Task whose level is open, for example support-1, where the command cannot open levels;
    default: the flat sandbox."""
    title: str = "Besiege"
    """Title of the game's window, whatever its case."""
    executable: str = "Besiege"
    """Name of the game's program, with or without its ending; with an empty one a window's title is
    enough."""
    calibration: Path | None = None
    """Calibration file; default STATE/calibration.json."""
    state: Path = Path.home() / ".buildarena" / "besiege"
    """Folder of the runner's own files: calibration, pid, screenshots."""
    pace: Annotated[float, Field(gt=0, le=20)] = 1.0
    """How much shorter than usual the waits between clicks are."""

    patience: Annotated[float, Field(gt=0, le=100)] = 1.0
    """How many times as long as usual the game may take."""

    @property
    def time_limits(self) -> TimeLimits:
        """Time limits for the game."""
        usual = asdict(TimeLimits())
        return TimeLimits(**{name: self.patience * limit_s for name, limit_s in usual.items()})

    @property
    def version(self) -> str | None:
        """The game and mod as tracks name them; None while one of them is not set."""
        return f"{self.game}-{self.mod}" if self.game and self.mod else None

    @property
    def machines_folder(self) -> Path | None:
        """Folder from which the game loads machine files; None without a game folder."""
        if self.machines is not None:
            return self.machines
        if self.folder is None:
            return None
        # Source: the published projects; the game's builds differ in where they look.
        places = ("SavedMachines", "Besiege_Data/SavedMachines", "Contents/SavedMachines")
        folders = [self.folder / place for place in places if (self.folder / place).is_dir()]
        return folders[0] if folders else self.folder / places[0]

    @property
    def calibration_file(self) -> Path:
        """The file of the calibration."""
        return self.calibration or self.state / "calibration.json"

    def words(self, level: Path | None) -> list[str]:
        """Return the command that starts the game with a level; empty if none is set."""
        text = "" if level is None else str(level)
        return [word.replace(LEVEL_FIELD, text) for word in _words(self.command)]

    @property
    def opens_levels(self) -> bool:
        """True if the game can be started with a level."""
        return LEVEL_FIELD in self.command


def _words(command: str, *, windows: bool = sys.platform == "win32") -> list[str]:
    r"""Split a command into words; on Windows ``\`` is a letter, and only double quotes group.

    Raises:
        ValueError: A quotation is not closed.
    """
    if not windows:
        return shlex.split(command)
    lexer = shlex.shlex(command, posix=False)
    lexer.whitespace_split, lexer.quotes, lexer.commenters = True, '"', ""
    return [word.replace('"', "") for word in lexer]


def level_digest(level: bytes | None) -> str:
    """Return a short name of a level, "sandbox" for none: equal levels have equal names."""
    return "sandbox" if level is None else hashlib.sha256(level).hexdigest()[:12]
