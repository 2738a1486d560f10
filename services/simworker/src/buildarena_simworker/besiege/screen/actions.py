"""Shared actions in a game's window: clicks, and steps whose effect is seen."""

from __future__ import annotations

import time
import unicodedata
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import structlog

from buildarena_simworker.besiege.errors import GameGoneError, StepFailedError
from buildarena_simworker.besiege.process import GameProcess
from buildarena_simworker.besiege.screen.calibration import PathClick
from buildarena_simworker.besiege.screen.input import SELECT, ScreenInput
from buildarena_simworker.besiege.screen.view import View
from buildarena_simworker.besiege.screen.windows import Windows
from buildarena_simworker.besiege.settings import TimeLimits

AFTER_CLICK_S: Final = 0.1

ATTEMPTS: Final = 3
POLL_S: Final = 0.1

log = structlog.get_logger(__name__)


@dataclass(frozen=True, slots=True)
class ScreenActions:
    """Mouse and keyboard for a game's window.

    Attributes:
        view: View of the window.
        windows: Finder of the window.
        limits: Time limits.
        is_alive: Function that checks if the game still runs.
    """

    view: View
    input: ScreenInput
    windows: Windows
    limits: TimeLimits
    is_alive: Callable[[], bool]

    def click(self, place: str) -> None:
        """Click on an item of the calibration."""
        self.input.click(*self.view.point(place))
        self.input.wait(AFTER_CLICK_S)

    def to_front(self) -> None:
        """Give the game the keyboard."""
        self.step(
            "bring the game to the front",
            self.windows.raise_,
            lambda: None if self.windows.is_active() else "another window has the keyboard",
        )
        self.input.wait(0.5)

    def recover(self) -> None:
        """Close dialogs and take the keyboard back."""
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
        """Repeat an action, which must be safe to repeat, until its effect is seen.

        Args:
            name: Name of the step in messages.
            act: Action.
            finding: Function that returns None once the effect is seen, otherwise what is seen.
            timeout_s: Time limit of the effect, seconds. Defaults to that of clicks.
            attempts: Maximum number of attempts; before the next one, what may block is cleared.

        Raises:
            StepFailedError: The effect was never seen.
        """

        def alive() -> str | None:
            if not self.is_alive():
                raise GameGoneError(f"{name}: the game is gone")
            return finding()

        limit, problem = self.limits.effect_s if timeout_s is None else timeout_s, None
        for attempt in range(attempts):
            if attempt:
                log.info("step_again", step=name, finding=problem)
                self.recover()
            act()
            problem = wait_for(alive, timeout_s=limit)
            if problem is None:
                return
        raise StepFailedError(name, str(problem))

    def opened(self, name: str, click: str, seen_at: str) -> None:
        """Open a panel with a click: the window changes at its position."""
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
        """Repeat an action of several steps from its beginning if one of them fails."""
        for left in reversed(range(ATTEMPTS)):
            try:
                act()
            except StepFailedError:
                if not left:
                    raise
                self.recover()
            else:
                return


def wait_for(finding: Callable[[], str | None], *, timeout_s: float) -> str | None:
    """Wait until something is seen.

    Args:
        finding: Function that returns None once it is seen, otherwise what is seen instead.
        timeout_s: Time limit, seconds.

    Returns:
        None when it was seen, otherwise the last finding.
    """
    ends = time.monotonic() + timeout_s
    while True:
        problem = finding()
        if problem is None or time.monotonic() >= ends:
            return problem
        time.sleep(POLL_S)


def start_game(
    process: GameProcess, actions: ScreenActions, level: bytes | None, path: tuple[PathClick, ...]
) -> None:
    """End the running game, and start it with its level open.

    It waits for a launcher that hands over and ends: the game is the process of its window.

    Args:
        actions: Actions in its window.
        level: Level, for a command that opens levels.
        path: Clicks from the title to the level.

    Raises:
        GameGoneError: It does not start; the message has its last output.
    """
    process.kill()
    process.start(level)
    limit_s = actions.limits.start_s
    finding = wait_for(lambda: _no_window(process, actions), timeout_s=limit_s)
    if finding is not None:
        raise GameGoneError(
            f"the game showed no {actions.windows.identity} within {limit_s:.0f} s: {finding}"
        )
    process.adopt(actions.windows.process())
    actions.input.wait(1.0)
    if path:
        actions.to_front()
    for click in path:
        actions.input.wait(click.wait_s)
        actions.input.click(*actions.view.at(click.x, click.y))


def _no_window(process: GameProcess, actions: ScreenActions) -> str | None:
    if actions.windows.find() is not None:
        return None
    if not process.awaited():
        raise GameGoneError(f"the game ended as it started: {process.last_words()}")
    return f"what it printed is in {process.output}"


def load_by_name(actions: ScreenActions, name: str) -> None:
    """Open the list of machines, type the name, and load; close the list after a failure.

    Raises:
        StepFailedError: The list does not open, take the name or close.
    """
    actions.opened("open the list of machines", "open_folder", "name_box")
    _type_name(actions, name)
    panel = actions.view.patch("name_box")
    actions.step(
        f"load the machine {name}",
        lambda: actions.click("open_machine"),
        lambda: (
            None
            if actions.view.differs("name_box", panel)
            else "the list of machines stayed open, so the game did not find or read its file"
        ),
        timeout_s=actions.limits.load_s,
        attempts=1,
    )


def strip_invisible(text: str) -> str:
    """Return a text without surrounding blanks and invisible characters.

    The game's boxes append a zero-width space to copied text.
    """
    return "".join(
        letter for letter in text if unicodedata.category(letter) not in {"Cf", "Cc"}
    ).strip()


def _type_name(actions: ScreenActions, name: str) -> None:
    screen = actions.input

    def retype() -> None:
        actions.click("name_box")
        screen.wait(0.5)
        screen.hotkey(SELECT, "a")
        screen.wait(0.2)
        screen.press("backspace")
        screen.wait(0.2)
        screen.write(name)
        screen.wait(0.1 * len(name))

    def read_back() -> str | None:
        copied = screen.copy_all()
        typed = None if copied is None else strip_invisible(copied)
        if typed is not None and typed != name and typed.casefold() == name:
            screen.press("capslock")
        return None if typed == name else f"{typed!r} is there instead"

    actions.step(f"type the name {name}", retype, read_back, timeout_s=0.0, attempts=1)
