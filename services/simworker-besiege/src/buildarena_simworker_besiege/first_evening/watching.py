"""A desktop that is watched: pictures as a run goes on, and how long copies of its log take."""

from __future__ import annotations

import time
from contextlib import suppress
from typing import Any, Final

from buildarena_besiege import GameRun
from buildarena_pipeline.evidence import Measured
from buildarena_simworker_besiege.desktop import Desktop
from buildarena_simworker_besiege.errors import DesktopError

PICTURE_WIDTH: Final = 640
SAVED_SUFFIX: Final = "saved"


class WatchedDesktop:
    """Passes everything on to a desktop.

    Args:
        desktop: The game.

    Attributes:
        saves: Whether the game saves each machine once it is loaded.
        takes_pictures: Whether pictures are taken as a run goes on.
        saved: What the game saved last; None before.
        pictures: The last picture of each moment, PNG.
    """

    def __init__(self, desktop: Desktop) -> None:
        self._desktop = desktop
        self._copies, self._last_end = 0, 0.0
        self._longest_copy_s, self._longest_pause_s = 0.0, 0.0
        self.forget()

    def forget(self) -> None:
        """Begins anew, for the next step."""
        self.saves = self.takes_pictures = False
        self.saved: bytes | None = None
        self.pictures: dict[str, bytes] = {}
        self._restart_clock()

    def __getattr__(self, name: str) -> Any:
        """Whatever else a desktop can do."""
        return getattr(self._desktop, name)

    def load(self, run: GameRun) -> None:
        """Loads the machine, and has the game save it where that is asked for."""
        self._restart_clock()
        self._desktop.load(run)
        self._picture("loaded")
        if self.saves:
            saving: Any = self._desktop
            self.saved = saving.save(f"{run.name}{SAVED_SUFFIX}")
            self._picture("saved")

    def start(self, run: GameRun) -> None:
        """Starts the simulation."""
        self._desktop.start(run)
        self._picture("started")
        self._last_end = time.monotonic()

    def read_log(self) -> str:
        """What the log shows; how long that takes is noted."""
        begun = time.monotonic()
        text = self._desktop.read_log()
        ended = time.monotonic()
        self._copies += 1
        self._longest_copy_s = max(self._longest_copy_s, ended - begun)
        if self._last_end:
            self._longest_pause_s = max(self._longest_pause_s, begun - self._last_end)
        self._last_end = ended
        return text

    def stop(self) -> None:
        """Stops the simulation: what is copied later is no part of the run."""
        self._picture("ended")
        self._desktop.stop()

    def clear(self) -> None:
        """Removes the machine from the game."""
        self._desktop.clear()
        self._picture("cleared")

    def screenshot(self) -> bytes | None:
        """The game's window alone, in place of a screen that shows other things as well."""
        window: Any = self._desktop
        if not hasattr(window, "window_picture"):
            return None
        picture: bytes = window.window_picture(PICTURE_WIDTH)
        return picture

    def measured(self, pace: float) -> Measured:
        """What was measured since the last machine was loaded."""
        return Measured(
            pace=pace,
            copies=self._copies,
            longest_copy_s=round(self._longest_copy_s, 3),
            longest_pause_s=round(self._longest_pause_s, 3),
        )

    def _restart_clock(self) -> None:
        self._copies, self._last_end = 0, 0.0
        self._longest_copy_s, self._longest_pause_s = 0.0, 0.0

    def _picture(self, moment: str) -> None:
        if self.takes_pictures:
            with suppress(DesktopError, OSError):
                picture = self.screenshot()
                if picture is not None:
                    self.pictures[moment] = picture
