"""Errors between the runner and the game."""

from __future__ import annotations


class DesktopError(Exception):
    """The game does not do what it should; trying again, or a restart, may help."""


class StepFailedError(DesktopError):
    """A step did not have the effect that shows its success.

    Args:
        step: Description of the step.
        finding: Effect that was seen instead.
    """

    def __init__(self, step: str, finding: str) -> None:
        super().__init__(f"{step}: {finding}")


class GameGoneError(DesktopError):
    """The game is not running, or has no window."""


class ScreenError(DesktopError):
    """Mouse, keyboard, clipboard or picture of the screen cannot be used at the moment."""


class NeedsPersonError(DesktopError):
    """Only a person at the machine can help; the job is requeued until then."""


class LevelClosedError(NeedsPersonError):
    """The job needs a level that is not open, and the runner cannot open it."""


class GameChangedError(NeedsPersonError):
    """The game or its mod is another than the one that was calibrated."""


class WrongLevelError(DesktopError):
    """The script measured another level than the one the job needs."""


class NotSetUpError(Exception):
    """This machine is not set up for the game; the message has the remedy."""
