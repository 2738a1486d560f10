"""Checks if this machine can play the game, point by point."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from buildarena_simworker.besiege.errors import DesktopError, GameChangedError, NotSetUpError
from buildarena_simworker.besiege.installed import APP, MOD_FOLDERS, Installed, installed
from buildarena_simworker.besiege.screen.calibration import load_calibration
from buildarena_simworker.besiege.screen.window import open_windows
from buildarena_simworker.besiege.screen.windows import find_window
from buildarena_simworker.besiege.settings import BesiegeSettings


@dataclass(frozen=True, slots=True)
class Finding:
    """Result of one check.

    Attributes:
        name: Subject of the check.
        ok: True if it passed.
        detail: Finding.
        advice: Action to take; "" if none is needed.
    """

    name: str
    ok: bool
    detail: str
    advice: str = ""


def examine(settings: BesiegeSettings) -> Iterator[Finding]:
    """Check everything that a run needs, whether or not something earlier is missing."""
    version = settings.version
    advice = "set BUILDARENA_BESIEGE_GAME and BUILDARENA_BESIEGE_MOD as the service has them"
    detail = f"besiege-{version}" if version else "not set"
    yield _found("versions", detail, "" if version else advice)
    yield _machines(settings)
    yield _command(settings)
    present = installed(settings.folder)
    yield _mod(settings, present)
    yield _build(settings, present)
    yield _check("display", "screen found", _display)
    yield _check("calibration", str(settings.calibration_file), lambda: _calibration(settings))
    yield _check("unchanged", "the game that was calibrated", lambda: _unchanged(settings, present))
    yield _check("window", f"titled {settings.title!r}", lambda: _window(settings))


def _found(name: str, detail: str, advice: str = "") -> Finding:
    """Return a finding that is a fault if it has an advice."""
    return Finding(name, not advice, detail, advice)


def _machines(settings: BesiegeSettings) -> Finding:
    folder, name = settings.machines_folder, "folder of machine files"
    if folder is None:
        return _found(name, "not set", "set BUILDARENA_BESIEGE_FOLDER to the game's folder")
    if folder.is_dir() and os.access(folder, os.W_OK):
        return _found(name, str(folder))
    advice = "start the game once, or correct BUILDARENA_BESIEGE_MACHINES"
    return _found(name, f"{folder} is missing or cannot be written", advice)


def _command(settings: BesiegeSettings) -> Finding:
    name, advice = "restart", "correct BUILDARENA_BESIEGE_COMMAND"
    if not settings.command:
        wish = "set BUILDARENA_BESIEGE_COMMAND, so that a frozen game is restarted"
        return Finding(name, True, "the runner cannot start the game by itself", wish)
    try:
        program = settings.words(None)[0]
    except (ValueError, IndexError) as error:
        return _found(name, str(error), advice)
    if shutil.which(program) is None:
        quotes = '; a path with blanks stands in quotes ("…")'
        return _found(name, f"there is no program {program}", advice + quotes)
    opens = "and opens levels" if settings.opens_levels else "with the level opened by hand"
    return _found(name, f"{settings.command} {opens}")


def _mod(settings: BesiegeSettings, present: Installed) -> Finding:
    name = "Lua Scripting Mod"
    if settings.folder is None:
        wish = "set BUILDARENA_BESIEGE_FOLDER to have it looked for"
        return Finding(name, True, "not looked for: the game's folder is not set", wish)
    if present.mod_file is None:
        missing = f"no Mod.xml of it in {', '.join(MOD_FOLDERS)} below {settings.folder}"
        advice = "subscribe to it in Steam's workshop, start the game once, and enable it"
        return _found(name, missing, advice)
    differs = settings.mod and present.mod and settings.mod != present.mod
    advice = f"BUILDARENA_BESIEGE_MOD is {settings.mod}: set it to {present.mod}"
    detail = f"{present.mod or 'no version'} in {present.mod_file}"
    return _found(name, detail, advice if differs else "")


def _build(settings: BesiegeSettings, present: Installed) -> Finding:
    name = "build of the game"
    if settings.folder is None:
        return _found(name, "not looked for: the game's folder is not set")
    if not present.build:
        missing = f"no appmanifest_{APP}.acf of Steam next to {settings.folder}"
        wish = "look yourself that the game is still the version that was calibrated"
        return Finding(name, True, missing, wish)
    return _found(name, f"{present.build}, as Steam has it")


def _unchanged(settings: BesiegeSettings, present: Installed) -> None:
    """Check if the game is the one that was calibrated."""
    try:
        present.require(load_calibration(settings.calibration_file).installed)
    except GameChangedError as error:
        raise NotSetUpError(str(error)) from error


def _check(name: str, detail: str, check: Callable[[], None]) -> Finding:
    try:
        check()
    except (NotSetUpError, DesktopError) as error:
        problem, _, advice = str(error).rpartition(": ")
        return Finding(name, False, problem or str(error), advice)
    return _found(name, detail)


def _display() -> None:
    from buildarena_simworker.besiege.screen.input import ScreenInput
    from buildarena_simworker.besiege.screen.view import screenshot

    screen_input = ScreenInput()
    try:
        screenshot()
        screen_input.clear_clipboard()
    finally:
        screen_input.close()


def _calibration(settings: BesiegeSettings) -> None:
    calibration = load_calibration(settings.calibration_file)
    _display()
    area = open_windows(settings).find()
    if area is not None and calibration.window not in {None, (area.width, area.height)}:
        was = "x".join(map(str, calibration.window or ()))
        raise NotSetUpError(
            f"it was made for a window of {was}, and the window is {area.width}x{area.height}: "
            "run `buildarena besiege calibrate`"
        )


def _window(settings: BesiegeSettings) -> None:
    _display()
    if not settings.command:
        find_window(open_windows(settings))
