"""What is installed on this machine, read from the files that Steam and the mod brought."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from buildarena_simworker.besiege.errors import GameChangedError

APP: Final = "346010"
"""The game's number at Steam."""

LUA_MOD_ID: Final = "479ad767-c2b6-4ce8-8a21-d57ecd0c5f2f"
"""Which the Lua Scripting Mod has in its Mod.xml. Source: its public repository."""

MOD_FOLDERS: Final = (
    "Besiege_Data/Mods",
    "Mods",
    f"../../workshop/content/{APP}",
    "Contents/Mods",
    "Besiege.app/Contents/Mods",
)
"""Where mods lie below the game's folder; the third is Steam's workshop beside it."""

MOD_DEPTH: Final = 2
"""Levels below such a folder at which a Mod.xml lies: the workshop has a number in between."""

_MANIFESTS: Final = (f"../../appmanifest_{APP}.acf", f"appmanifest_{APP}.acf")
_BUILD: Final = re.compile(r'"buildid"\s+"(\d{1,20})"')
_VERSION: Final = re.compile(r"<Version>\s*([^<\s]{1,40})\s*</Version>", re.IGNORECASE)
_ID: Final = re.compile(r"<ID>\s*([^<\s]{1,60})\s*</ID>", re.IGNORECASE)
_NAME: Final = re.compile(r"<Name>\s*([^<]{1,200}?)\s*</Name>", re.IGNORECASE)
_LONGEST_FILE: Final = 1 << 20


@dataclass(frozen=True, slots=True, kw_only=True)
class Installed:
    """What was found; "" for what was not.

    Attributes:
        build: Steam's number of the game's build.
        mod: The Lua Scripting Mod's version.
        mod_file: The file that says so; None without one.
    """

    build: str = ""
    mod: str = ""
    mod_file: Path | None = None

    def as_facts(self) -> Mapping[str, str]:
        """What a calibration and a manifest keep of it; nothing of what was not found."""
        facts = {"build": self.build, "mod_file_version": self.mod}
        return {name: value for name, value in facts.items() if value}

    def require(self, recorded: Mapping[str, str]) -> None:
        """Refuses to play another game or mod than the one that was calibrated.

        Args:
            recorded: Facts of the calibration.

        Raises:
            GameChangedError: Something differs; the message says what and what to do.
        """
        facts = self.as_facts()
        changed = [
            f"{what} was {recorded[name]} when it was calibrated and is "
            f"{facts.get(name, 'not found')}"
            for name, what in (("build", "the game's build"), ("mod_file_version", "the mod"))
            if name in recorded and recorded[name] != facts.get(name)
        ]
        if changed:
            raise GameChangedError(
                f"{' and '.join(changed)}: look which versions they are, set "
                "BUILDARENA_BESIEGE_GAME and BUILDARENA_BESIEGE_MOD here and at the service, and "
                "run `buildarena besiege calibrate`"
            )


def installed(folder: Path | None) -> Installed:
    """What is installed below a game's folder, and beside it by Steam; nothing without a folder."""
    if folder is None:
        return Installed()
    texts = (_read(folder / name) for name in _MANIFESTS)
    builds = [match[1] for match in map(_BUILD.search, texts) if match]
    mod = next(_lua_mods(folder), None)
    return Installed(
        build=builds[0] if builds else "",
        mod=mod[1] if mod else "",
        mod_file=mod[0] if mod else None,
    )


def _lua_mods(folder: Path) -> Iterator[tuple[Path, str]]:
    """Each file of a Lua Scripting Mod with the version in it, the mod's own id first."""
    mods = []
    for place in MOD_FOLDERS:
        for depth in range(1, MOD_DEPTH + 1):
            for file in sorted((folder / place).glob("*/" * depth + "[Mm]od.xml")):
                text = _read(file)
                known, name = _ID.search(text), _NAME.search(text)
                own = known is not None and known[1].casefold() == LUA_MOD_ID
                if own or (name is not None and "lua" in name[1].casefold()):
                    version = _VERSION.search(text)
                    mods.append((not own, file, version[1] if version else ""))
    yield from ((file, version) for _, file, version in sorted(mods, key=lambda mod: mod[0]))


def _read(file: Path) -> str:
    """A file's text; "" if it cannot be read or is far too long to be one of these."""
    try:
        if file.stat().st_size > _LONGEST_FILE:
            return ""
        return file.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""
