"""Plays one run: load, start, read the log until it ends, stop, clean up; repeated if needed."""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Final

import structlog

from buildarena_besiege import GameLog, GameRun, LogIncompleteError, prepare_run
from buildarena_geometry import KeyPress, Machine
from buildarena_simulation import ControllerFailed, Scenario, Trajectory
from buildarena_simworker.besiege.errors import (
    DesktopError,
    GameGoneError,
    NeedsPersonError,
    StepFailedError,
)
from buildarena_simworker.besiege.screen.window import WindowDesktop
from buildarena_simworker.besiege.settings import TimeLimits

log = structlog.get_logger(__name__)

ATTEMPTS: Final = 3
SLOWEST: Final = 10.0
"""Maximum wall-clock time of a run, as a multiple of its duration."""
POLL_S: Final = 0.1
HIGHEST_START: Final = 1.5
"""Maximum height above its position on the ground of a machine's first sample, units."""
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
    desktop: WindowDesktop,
    machine: Machine,
    scenario: Scenario,
    *,
    name: str,
    prefix: str,
    require_held: Callable[[], None],
    limits: TimeLimits,
    controls: Sequence[KeyPress] | None = None,
) -> Played:
    """Play a run, from a clean game to a clean game, until its log can be trusted.

    Args:
        name: Name of the machine's file.
        prefix: Beginning of the run ids. Each attempt has another one: lines of a failed attempt
            are never taken for another's.
        require_held: Function that raises when the lease is lost; the game is cleaned up then, too.
        limits: Time limits.
        controls: Key presses; None for the machine's own.

    Raises:
        RunFailedError: No attempt was completed.
    """
    faults: list[str] = []
    screenshots: list[bytes] = []
    for attempt in range(ATTEMPTS):
        run_id = f"{prefix}{attempt}{uuid.uuid4().hex[:8]}"
        run = prepare_run(machine, scenario, name=name, run_id=run_id, controls=controls)
        desktop.require_able(run)
        try:
            game_log, pace = _attempt(desktop, run, require_held, limits)
            try:
                trajectory, failure = desktop.trajectory(game_log, machine, scenario), ""
                require_start(trajectory, machine, run)
            except ControllerFailed as error:  # the machine's own failure, in a run that ended well
                trajectory, failure = None, str(error)
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


def require_start(trajectory: Trajectory, machine: Machine, run: GameRun) -> None:
    """Check that the machine was on the ground at the right start.

    The effect of the button that puts a machine on the ground cannot be checked directly; a machine
    that it missed starts several units higher, and would be scored for its fall.

    Raises:
        LogIncompleteError: The start is wrong.
    """
    if not run.set_ground or not len(trajectory.block_ids):
        return
    lowest = float(machine.bounds[0][2])
    block = machine.blocks[trajectory.block_ids[0]]
    height = float(trajectory.positions[0, 0, 2])
    above = height - (block.center_xyz[2] - lowest)
    if above > HIGHEST_START:
        raise LogIncompleteError(
            f"the machine started {above:.1f} units above the ground: it was not put down"
        )


def _attempt(
    desktop: WindowDesktop, run: GameRun, require_held: Callable[[], None], limits: TimeLimits
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
    desktop: WindowDesktop,
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
    while not (game_log.ended or game_log.time_s >= run.duration_s):
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


def _pictures(desktop: WindowDesktop) -> list[bytes]:
    try:
        picture = desktop.screenshot()
    except (OSError, DesktopError):
        return []
    return [] if picture is None else [picture]


def _start_clean(desktop: WindowDesktop, faults: list[str]) -> None:
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
