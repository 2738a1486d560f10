"""Versions installed on this machine, read from the files of Steam and the mod."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from buildarena_simworker.besiege.errors import GameChangedError

APP: Final = "346010"
"""Id of the game in Steam."""

LUA_MOD_ID: Final = "479ad767-c2b6-4ce8-8a21-d57ecd0c5f2f"
"""Id of the Lua Scripting Mod in its Mod.xml. Source: its public repository."""

MOD_FOLDERS: Final = (
    "Besiege_Data/Mods",
    "Mods",
    f"../../workshop/content/{APP}",
    "Contents/Mods",
    "Besiege.app/Contents/Mods",
)
"""Folders of mods below the game's folder; the third is Steam's workshop next to it."""

MOD_DEPTH: Final = 2
"""Depth of a Mod.xml below such a folder: the workshop has a number in between."""

_MANIFESTS: Final = (f"../../appmanifest_{APP}.acf", f"appmanifest_{APP}.acf")
_BUILD: Final = re.compile(r'"buildid"\s+"(\d{1,20})"')
_VERSION: Final = re.compile(r"<Version>\s*([^<\s]{1,40})\s*</Version>", re.IGNORECASE)
_ID: Final = re.compile(r"<ID>\s*([^<\s]{1,60})\s*</ID>", re.IGNORECASE)
_NAME: Final = re.compile(r"<Name>\s*([^<]{1,200}?)\s*</Name>", re.IGNORECASE)
_LONGEST_FILE: Final = 1 << 20


@dataclass(frozen=True, slots=True, kw_only=True)
class Installed:
    """Installed versions; "" for missing ones.

    Attributes:
        build: Steam's number of the game's build.
        mod: The Lua Scripting Mod's version.
        mod_file: File with the mod's version; None without one.
    """

    build: str = ""
    mod: str = ""
    mod_file: Path | None = None

    def as_facts(self) -> Mapping[str, str]:
        """Return the versions for a calibration and a manifest, without missing ones."""
        facts = {"build": self.build, "mod_file_version": self.mod}
        return {name: value for name, value in facts.items() if value}

    def require(self, recorded: Mapping[str, str]) -> None:
        """Check that game and mod are the ones that were calibrated.

        Args:
            recorded: Facts of the calibration.

        Raises:
            GameChangedError: A version differs; the message has the difference and the remedy.
        """
        facts = self.as_facts()
        changed = [
            f"{subject} was {recorded[name]} when it was calibrated and is "
            f"{facts.get(name, 'not found')}"
            for name, subject in (("build", "the game's build"), ("mod_file_version", "the mod"))
            if name in recorded and recorded[name] != facts.get(name)
        ]
        if changed:
            raise GameChangedError(
                f"{' and '.join(changed)}: look which versions they are, set "
                "BUILDARENA_BESIEGE_GAME and BUILDARENA_BESIEGE_MOD here and at the service, and "
                "run `buildarena besiege calibrate`"
            )


def installed(folder: Path | None) -> Installed:
    """Return the versions below a game's folder and in Steam's folder; none without a folder."""
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
    """Yield the files of Lua Scripting Mods with their versions, the mod's own id first."""
    mods = []
    for place in MOD_FOLDERS:
        for depth in range(1, MOD_DEPTH + 1):
            for file in sorted((folder / place).glob("*/" * depth + "[Mm]od.xml")):
                text = _read(file)
                mod_id, name = _ID.search(text), _NAME.search(text)
                own = mod_id is not None and mod_id[1].casefold() == LUA_MOD_ID
                if own or (name is not None and "lua" in name[1].casefold()):
                    version = _VERSION.search(text)
                    mods.append((not own, file, version[1] if version else ""))
    yield from ((file, version) for _, file, version in sorted(mods, key=lambda mod: mod[0]))


def _read(file: Path) -> str:
    """Return a file's text; "" if it cannot be read or is much too long."""
    try:
        if file.stat().st_size > _LONGEST_FILE:
            return ""
        return file.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""
