"""Desktop of the game on this machine, from its settings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from buildarena_simworker.besiege.errors import NotSetUpError
from buildarena_simworker.besiege.installed import installed
from buildarena_simworker.besiege.screen.calibration import load_calibration
from buildarena_simworker.besiege.screen.window import WindowDesktop
from buildarena_simworker.besiege.settings import BesiegeSettings


def make_desktop(settings: BesiegeSettings) -> tuple[WindowDesktop, Mapping[str, Any]]:
    """Return the game, and a manifest's data on how it is driven.

    Raises:
        NotSetUpError: Something is missing; the message has the remedy.
    """
    folder = settings.machines_folder
    if folder is None or not folder.is_dir():
        raise NotSetUpError(
            f"there is no folder of machine files {folder}: set BUILDARENA_BESIEGE_FOLDER to the "
            "game's folder, or BUILDARENA_BESIEGE_MACHINES to the folder itself"
        )
    from buildarena_simworker.besiege.screen.input import ScreenInput
    from buildarena_simworker.besiege.screen.window import WindowDesktop
    from buildarena_simworker.besiege.screen.window_types import WindowIdentity
    from buildarena_simworker.besiege.screen.windows import open_windows

    calibration = load_calibration(settings.calibration_file)
    screen_input = ScreenInput(settings.pace)
    windows = open_windows(WindowIdentity(title=settings.title, executable=settings.executable))
    desktop = WindowDesktop(settings, calibration, screen_input, windows)
    facts = {
        "calibration": calibration.digest,
        "screen": "x".join(map(str, screen_input.screen_size())),
        **installed(settings.folder).as_facts(),
    }
    return desktop, facts
