"""Whether this machine can play the game, point by point."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from buildarena_simworker_besiege.errors import NotSetUpError
from buildarena_simworker_besiege.screen.calibration import load_calibration
from buildarena_simworker_besiege.settings import BesiegeSettings

MOD_FOLDERS = ("Besiege_Data/Mods", "Mods", "../../workshop/content/346010", "Contents/Mods")
"""Where mods lie below the game's folder; the third is Steam's workshop beside it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One point.

    Attributes:
        name: What was looked at.
        ok: Whether it is as it should be.
        detail: What was found.
        advice: What to do; "" when nothing need be done.
    """

    name: str
    ok: bool
    detail: str
    advice: str = ""


def examine(settings: BesiegeSettings) -> list[Finding]:
    """Everything that a run needs, whether or not something earlier is missing."""
    return list(_findings(settings))


def _findings(settings: BesiegeSettings) -> Iterator[Finding]:
    yield Finding(
        name="versions",
        ok=settings.version is not None,
        detail=f"besiege-{settings.version}" if settings.version else "not set",
        advice=""
        if settings.version
        else "set BUILDARENA_BESIEGE_GAME and BUILDARENA_BESIEGE_MOD as the service has them",
    )
    yield _machines(settings)
    yield _command(settings)
    if settings.desktop == "window":
        yield _mod(settings)
        yield _tried("display", "screen found", _display)
        yield _tried("calibration", str(settings.calibration_file), lambda: _calibration(settings))
        yield _tried("window", f"titled {settings.title!r}", lambda: _window(settings))


def _machines(settings: BesiegeSettings) -> Finding:
    folder = settings.machines_folder
    name = "folder of machine files"
    if folder is None:
        advice = "set BUILDARENA_BESIEGE_FOLDER to the game's folder"
        return Finding(name=name, ok=False, detail="not set", advice=advice)
    able = folder.is_dir() and os.access(folder, os.W_OK)
    detail = str(folder) if able else f"{folder} is missing or cannot be written"
    advice = "" if able else "start the game once, or correct BUILDARENA_BESIEGE_MACHINES"
    return Finding(name=name, ok=able, detail=detail, advice=advice)


def _command(settings: BesiegeSettings) -> Finding:
    if not settings.command:
        needed = settings.desktop == "headless"
        return Finding(
            name="restart",
            ok=not needed,
            detail="the runner cannot start the game by itself",
            advice="set BUILDARENA_BESIEGE_COMMAND, so that a frozen game is restarted",
        )
    opens = "and opens levels" if settings.opens_levels else "with the level opened by hand"
    return Finding(name="restart", ok=True, detail=f"{settings.command} {opens}")


def _mod(settings: BesiegeSettings) -> Finding:
    name = "Lua Scripting Mod"
    if settings.folder is None:
        return Finding(
            name=name,
            ok=True,
            detail="not looked for: the game's folder is not set",
            advice="set BUILDARENA_BESIEGE_FOLDER to have it looked for",
        )
    for place in MOD_FOLDERS:
        folder = settings.folder / place
        mod = _lua_mod(folder) if folder.is_dir() else None
        if mod is not None:
            return Finding(name=name, ok=True, detail=str(mod))
    return Finding(
        name=name,
        ok=False,
        detail=f"no folder or manifest that speaks of Lua below {settings.folder}",
        advice="subscribe to the Lua Scripting Mod in Steam's workshop and start the game once",
    )


def _lua_mod(folder: Path) -> Path | None:
    """A mod of that kind, recognised by its folder's name or its manifest."""
    for mod in sorted(folder.iterdir()):
        if not mod.is_dir():
            continue
        if "lua" in mod.name.casefold():
            return mod
        for manifest in mod.glob("*od.xml"):
            if "lua" in manifest.read_text(encoding="utf-8", errors="replace").casefold():
                return mod
    return None


def _tried(name: str, detail: str, check: Callable[[], None]) -> Finding:
    try:
        check()
    except NotSetUpError as error:
        what, _, advice = str(error).rpartition(": ")
        return Finding(name=name, ok=False, detail=what or str(error), advice=advice)
    return Finding(name=name, ok=True, detail=detail)


def _display() -> None:
    from buildarena_simworker_besiege.screen.capture import screenshot
    from buildarena_simworker_besiege.screen.input import ScreenInput

    screen_input = ScreenInput()
    try:
        screenshot()
        screen_input.clear_clipboard()
    finally:
        screen_input.close()


def _calibration(settings: BesiegeSettings) -> None:
    from buildarena_simworker_besiege.screen.windows import open_windows

    calibration = load_calibration(settings.calibration_file)
    _display()
    area = open_windows().find(settings.title)
    if area is not None and calibration.window not in {None, (area.width, area.height)}:
        was = "x".join(map(str, calibration.window or ()))
        raise NotSetUpError(
            f"it was made for a window of {was}, and the window is {area.width}x{area.height}: "
            "run `buildarena besiege calibrate`"
        )


def _window(settings: BesiegeSettings) -> None:
    from buildarena_simworker_besiege.screen.windows import open_windows

    _display()
    if open_windows().find(settings.title) is None and not settings.command:
        raise NotSetUpError(
            f"no window has {settings.title!r} in its title: start the game, or correct "
            "BUILDARENA_BESIEGE_TITLE"
        )
