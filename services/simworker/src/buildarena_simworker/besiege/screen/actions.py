"""What every part of playing in a window does: clicks, and steps whose effect is seen."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from buildarena_simworker.besiege.errors import GameGoneError, StepFailedError
from buildarena_simworker.besiege.screen.input import ScreenInput
from buildarena_simworker.besiege.screen.steps import ATTEMPTS, take_step
from buildarena_simworker.besiege.screen.view import View
from buildarena_simworker.besiege.screen.window_types import Windows
from buildarena_simworker.besiege.time_limits import TimeLimits

AFTER_CLICK_S: Final = 0.1


class ScreenActions:
    """Mouse and keyboard over a game's window.

    Args:
        view: What the window shows.
        screen_input: Mouse, keyboard and clipboard.
        windows: Finds the window.
        limits: How long to wait.
        is_alive: Whether the game is still there.
    """

    def __init__(
        self,
        view: View,
        screen_input: ScreenInput,
        windows: Windows,
        limits: TimeLimits,
        is_alive: Callable[[], bool],
    ) -> None:
        self.view = view
        self.input = screen_input
        self.windows = windows
        self.limits = limits
        self._is_alive = is_alive

    def click(self, place: str) -> None:
        """Clicks at a place of the calibration."""
        self.input.click(*self.view.point(place))
        self.input.wait(AFTER_CLICK_S)

    def to_front(self) -> None:
        """Gives the game the keyboard."""
        self.step(
            "bring the game to the front",
            self.windows.raise_,
            lambda: None if self.windows.is_active() else "another window has the keyboard",
        )
        self.input.wait(0.5)

    def recover(self) -> None:
        """Closes dialogs and takes the keyboard back."""
        self.input.release_all()
        self.input.press("escape")
        self.input.wait(0.2)
        self.windows.raise_()
        self.input.wait(0.2)

    def step(
        self,
        name: str,
        act: Callable[[], None],
        finding: Callable[[], str | None],
        *,
        timeout_s: float | None = None,
        attempts: int = ATTEMPTS,
    ) -> None:
        """Does something until its effect is seen; see `take_step`."""

        def alive() -> str | None:
            if not self._is_alive():
                raise GameGoneError(f"{name}: the game is gone")
            return finding()

        limit = self.limits.effect_s if timeout_s is None else timeout_s
        take_step(name, act, alive, timeout_s=limit, recover=self.recover, attempts=attempts)

    def opened(self, name: str, click: str, seen_at: str) -> None:
        """Opens a panel with a click: the window changes where it lies."""
        before = self.view.patch(seen_at)

        def act() -> None:
            if not self.view.differs(seen_at, before):
                self.click(click)

        self.step(
            name,
            act,
            lambda: (
                None
                if self.view.differs(seen_at, before)
                else "nothing changed in the window where it should appear"
            ),
        )

    def by_attempts(self, act: Callable[[], None]) -> None:
        """Does something of several steps again from its beginning when one of them fails."""
        for left in reversed(range(ATTEMPTS)):
            try:
                act()
            except StepFailedError:
                if not left:
                    raise
                self.recover()
            else:
                return
