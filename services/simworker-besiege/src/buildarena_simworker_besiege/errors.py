"""What can go wrong between the runner and the game."""

from __future__ import annotations


class DesktopError(Exception):
    """The game does not do what it should; trying again, or a restart, may help."""


class StepFailedError(DesktopError):
    """A step had not the effect that shows it worked.

    Args:
        step: What was tried.
        finding: What was seen instead.
    """

    def __init__(self, step: str, finding: str) -> None:
        super().__init__(f"{step}: {finding}")
        self.step = step


class GameGoneError(DesktopError):
    """The game is not running, or has no window."""


class LevelClosedError(DesktopError):
    """The job needs a level that is not open, and the runner cannot open it."""


class NotSetUpError(Exception):
    """This machine is not set up for the game; the message says what to do."""
