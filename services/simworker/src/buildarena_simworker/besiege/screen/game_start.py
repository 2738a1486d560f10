"""Starting the game: by its command, past its launcher and title, to the level."""

from __future__ import annotations

from buildarena_simworker.besiege.errors import GameGoneError
from buildarena_simworker.besiege.process import GameProcess
from buildarena_simworker.besiege.screen.actions import ScreenActions
from buildarena_simworker.besiege.screen.calibration import PathClick
from buildarena_simworker.besiege.screen.steps import wait_for


def start_game(
    process: GameProcess, actions: ScreenActions, level: bytes | None, path: tuple[PathClick, ...]
) -> None:
    """Ends the game there is, and starts it anew with its level open.

    A launcher that hands over and ends is waited for: the game is the process of its window.

    Args:
        process: The game.
        actions: Over its window.
        level: Where the command opens levels.
        path: The clicks that lead from the title to the level.

    Raises:
        GameGoneError: It does not start; the message has its last words.
    """
    process.kill()
    process.start(level)
    limit_s = actions.limits.start_s
    finding = wait_for(lambda: _no_window(process, actions), timeout_s=limit_s)
    if finding is not None:
        raise GameGoneError(
            f"the game showed no {actions.windows.wanted} within {limit_s:.0f} s: {finding}"
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
