"""Plays one run: load, start, read the log until it ends, stop, clean up; repeated if needed."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Final

import structlog

from buildarena_besiege import GameLog, GameRun, LogIncompleteError
from buildarena_simulation import ControllerFailed, Trajectory
from buildarena_simworker.besiege.desktop import Desktop
from buildarena_simworker.besiege.errors import (
    DesktopError,
    GameGoneError,
    NeedsPersonError,
    StepFailedError,
)
from buildarena_simworker.besiege.settings import TimeLimits

log = structlog.get_logger(__name__)

ATTEMPTS: Final = 3
SLOWEST: Final = 10.0
"""Maximum wall-clock time of a run, as a multiple of its duration."""
POLL_S: Final = 0.1
LAGGING: Final = 0.9
"""Minimum speed of the game's time relative to the wall clock; a slower game lags."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Played:
    """A run that was completed.

    Attributes:
        log: Output of the game.
        trajectory: Trajectory in the log; None if the machine's program failed.
        pace: Seconds of game time per second of wall-clock time.
        faults: Faults of earlier attempts.
        failure: Failure of the machine's program; "" if there was none.
    """

    run: GameRun
    log: GameLog
    trajectory: Trajectory | None
    pace: float
    faults: tuple[str, ...]
    failure: str = ""


class RunFailedError(Exception):
    """No attempt was completed reliably.

    Attributes:
        screenshots: Screen at each failure, PNG.
        waits_for_person: True if only a person can help.
    """

    def __init__(
        self, message: str, screenshots: list[bytes], *, waits_for_person: bool = False
    ) -> None:
        super().__init__(message)
        self.screenshots = screenshots
        self.waits_for_person = waits_for_person


def play(
    desktop: Desktop,
    make_run: Callable[[int], GameRun],
    read: Callable[[GameRun, GameLog], Trajectory],
    *,
    require_held: Callable[[], None],
    limits: TimeLimits,
) -> Played:
    """Play a run, from a clean game to a clean game, until its log can be trusted.

    Args:
        make_run: Function that prepares the run for an attempt, each with a separate run id: lines
            of a failed attempt are never taken for another's.
        read: Function that returns the trajectory of a log, or raises `LogIncompleteError` if the
            log cannot be trusted.
        require_held: Function that raises when the lease is lost; the game is cleaned up then, too.
        limits: Time limits.

    Raises:
        RunFailedError: No attempt was completed.
    """
    faults: list[str] = []
    screenshots: list[bytes] = []
    for attempt in range(ATTEMPTS):
        run = make_run(attempt)
        desktop.require_able(run)
        try:
            game_log, pace = _attempt(desktop, run, require_held, limits)
            trajectory, failure = _outcome(read, run, game_log)
        except NeedsPersonError as error:
            screenshots += _pictures(desktop)
            _start_clean(desktop, faults)
            raise RunFailedError(str(error), screenshots, waits_for_person=True) from error
        except (DesktopError, LogIncompleteError) as error:
            log.warning("run_failed", attempt=attempt, error=str(error))
            faults.append(str(error))
            screenshots += _pictures(desktop)
            _start_clean(desktop, faults)
            continue
        except BaseException:
            _start_clean(desktop, faults)
            raise
        return Played(
            run=run,
            log=game_log,
            trajectory=trajectory,
            pace=pace,
            faults=tuple(faults),
            failure=failure,
        )
    raise RunFailedError("; ".join(dict.fromkeys(faults)), screenshots)


def _outcome(
    read: Callable[[GameRun, GameLog], Trajectory], run: GameRun, game_log: GameLog
) -> tuple[Trajectory | None, str]:
    """Return the trajectory of a log, or the program's failure in a run that ended well."""
    try:
        return read(run, game_log), ""
    except ControllerFailed as failure:
        return None, str(failure)


def _attempt(
    desktop: Desktop, run: GameRun, require_held: Callable[[], None], limits: TimeLimits
) -> tuple[GameLog, float]:
    desktop.prepare(run)
    require_held()
    desktop.load(run)
    require_held()
    desktop.start(run)
    game_log = desktop.new_log(run)
    started = time.monotonic()
    _follow(desktop, run, game_log, require_held, limits)
    elapsed = time.monotonic() - started
    desktop.stop()
    game_log.read(desktop.read_log())
    desktop.require_level(run, game_log)
    desktop.clear()
    return game_log, run.duration_s / max(elapsed, 1e-3)


def _follow(
    desktop: Desktop,
    run: GameRun,
    game_log: GameLog,
    require_held: Callable[[], None],
    limits: TimeLimits,
) -> None:
    """Read the log until the run is over.

    Raises:
        DesktopError: The run does not begin, or stalls, or its script fails.
    """
    started = heard = time.monotonic()
    newest = 0.0
    while not _is_over(game_log, run):
        require_held()
        game_log.read(desktop.read_log())
        desktop.require_level(run, game_log)
        now = time.monotonic()
        if game_log.complaints:
            raise StepFailedError("run the script", f"the game says {game_log.complaints[0]!r}")
        if game_log.time_s > newest:
            newest, heard = game_log.time_s, now
        if not desktop.is_alive():
            raise GameGoneError("the game ended while the machine ran")
        if not game_log.begun and now - started > limits.begin_s:
            raise StepFailedError("start the simulation", "its first line did not appear")
        if now - heard > limits.stall_s:
            raise StepFailedError(
                "follow the log", f"nothing new for {limits.stall_s:.0f} s after {newest:.1f} s"
            )
        if now - started > limits.begin_s + SLOWEST * run.duration_s:
            raise StepFailedError("follow the log", f"the game is too slow: {newest:.1f} s so far")
        time.sleep(POLL_S)


def _is_over(game_log: GameLog, run: GameRun) -> bool:
    return game_log.ended or game_log.time_s >= run.duration_s


def _pictures(desktop: Desktop) -> list[bytes]:
    try:
        picture = desktop.screenshot()
    except (OSError, DesktopError):
        return []
    return [] if picture is None else [picture]


def _start_clean(desktop: Desktop, faults: list[str]) -> None:
    """Leave no machine and no key behind: by a restart, or by hand where that is impossible."""
    try:
        desktop.restart()
    except DesktopError as error:
        log.warning("restart_failed", error=str(error))
        if str(error) not in faults:
            faults.append(str(error))
        with suppress(DesktopError):
            desktop.recover()
            desktop.clear()
