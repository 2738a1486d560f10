"""Walks a person through calibration, and tries the result with a small machine."""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable
from dataclasses import replace
from typing import Final

from buildarena_benchmark import builtin_tasks
from buildarena_besiege import GameRun, prepare_run
from buildarena_geometry import Machine
from buildarena_simulation import Scenario
from buildarena_simulation.scenario import TerrainBox
from buildarena_simworker.besiege.desktop import Desktop
from buildarena_simworker.besiege.errors import DesktopError, NotSetUpError
from buildarena_simworker.besiege.installed import Installed
from buildarena_simworker.besiege.play import Played, RunFailedError, play
from buildarena_simworker.besiege.screen.calibration import (
    MAX_WAIT_S,
    PIXELS,
    POSITIONS,
    Calibration,
    PathClick,
)
from buildarena_simworker.besiege.screen.input import ScreenInput
from buildarena_simworker.besiege.screen.window_types import Area, Windows
from buildarena_simworker.besiege.settings import BesiegeSettings, TimeLimits

BEFORE: Final = {
    "name_box": "Open the list of machine files in the game.",
    "set_ground": "Close the list of machine files.",
    "confirm": "Click the button that deletes the machine, so that the game asks for confirmation.",
}
"""What must be done in the game before some places can be seen."""
TRIAL_S: Final = 2.0
KEEP: Final = "k"
DONE: Final = "d"
LOG: Final = "log_window"
OUTSIDE: Final = "The mouse is not over the game's window."

Ask = Callable[[str], str]
Tell = Callable[[str], None]


def ask_positions(
    screen_input: ScreenInput,
    windows: Windows,
    *,
    ask: Ask,
    tell: Tell,
    before: Calibration,
) -> Calibration:
    """Asks for each place; a person points at it with the mouse.

    Args:
        screen_input: Tells where the mouse is.
        windows: Finds the game's window.
        ask: Shows a question and gives the answer.
        tell: Shows a line.
        before: Positions that are kept unless the answer changes them.

    Raises:
        NotSetUpError: There is no such window.
    """
    places = dict(before.positions)
    for name, (_, description) in POSITIONS.items():
        if name in BEFORE:
            tell(BEFORE[name])
        x, y = places[name]
        present = f"{x:.3f}, {y:.3f}"
        point = _pointed(screen_input, windows, ask, tell, what=description, now=present)
        if point is not None:
            places[name] = _fractions(point, _window(windows))
    window = _window(windows)
    return replace(before, positions=places, window=(window.width, window.height), screen=None)


def ask_log(
    screen_input: ScreenInput, windows: Windows, *, ask: Ask, tell: Tell, before: Calibration
) -> Calibration:
    """Asks for the mod's log, which is drawn only while a machine has printed something.

    Args:
        screen_input: Tells where the mouse is.
        windows: Finds the game's window.
        ask: Shows a question and gives the answer.
        tell: Shows a line.
        before: What is kept unless the answer changes it.
    """
    x, y = before.pixels[LOG]
    tell("A machine runs and prints. If no log is shown, press Ctrl+L in the game.")
    point = _pointed(screen_input, windows, ask, tell, what=PIXELS[LOG][1], now=f"{x}, {y}")
    if point is None:
        return before
    window = _window(windows)
    place = (point[0] - window.left, point[1] - window.top)
    return replace(before, pixels={**before.pixels, LOG: place})


def record_path(
    screen_input: ScreenInput, windows: Windows, *, ask: Ask, tell: Tell, before: Calibration
) -> Calibration:
    """Records the clicks that lead from the game's title to its level, and the waits between.

    Args:
        screen_input: Tells where the mouse is.
        windows: Finds the game's window.
        ask: Shows a question and gives the answer.
        tell: Shows a line.
        before: What is kept.
    """
    tell("Start the game, and wait until its title is shown.")
    clicks: list[PathClick] = []
    last = time.monotonic()
    while True:
        answer = ask(
            f"Point the mouse at what is clicked as number {len(clicks) + 1}, press Enter here, "
            f"and click it then ({DONE} and Enter once the level is open): "
        )
        if answer.strip().casefold() == DONE:
            break
        window, point = _window(windows), screen_input.position()
        if not _inside(point, window):
            tell(OUTSIDE)
            continue
        now = time.monotonic()
        x, y = _fractions(point, window)
        clicks.append(PathClick(x=x, y=y, wait_s=round(min(now - last, MAX_WAIT_S), 1)))
        last = now
    return replace(before, path=tuple(clicks))


def opened_terrain(settings: BesiegeSettings) -> tuple[TerrainBox, ...]:
    """The terrain of the level that the owner says is open; none where the game opens its own."""
    task = None if settings.opens_levels else builtin_tasks().get(settings.level)
    return () if task is None else task.scenario.terrain


def printing_run(terrain: tuple[TerrainBox, ...] = ()) -> GameRun:
    """A machine whose log a person can point at: its end line is printed again forever.

    Args:
        terrain: Of the level that is open.
    """
    machine, scenario = _tried(terrain)
    return prepare_run(machine, scenario, name="baprint", run_id=f"print{uuid.uuid4().hex[:8]}")


def try_out(
    desktop: Desktop, limits: TimeLimits, tell: Tell, terrain: tuple[TerrainBox, ...] = ()
) -> Played | None:
    """Plays a machine of two blocks for two seconds, from loading to deleting.

    Args:
        desktop: The game, driven by the positions to be tried.
        limits: How long to wait.
        tell: Shows a line for each thing that worked or did not.
        terrain: Of the level that is open.

    Returns:
        The run; None if something did not work.
    """
    machine, scenario = _tried(terrain)

    def make_run(attempt: int) -> GameRun:
        return prepare_run(
            machine, scenario, name="batry", run_id=f"try{attempt}{uuid.uuid4().hex[:8]}"
        )

    try:
        played = play(
            desktop,
            make_run,
            lambda _, log: desktop.trajectory(log, machine, scenario),
            require_held=lambda: None,
            limits=limits,
        )
    except (RunFailedError, DesktopError) as error:
        tell(f"It does not work yet: {error}")
        return None
    tell(f"Loaded, started, read ({TRIAL_S:.0f} s at {played.pace:.2f} of real time), deleted.")
    for fault in played.faults:
        tell(f"It needed another try: {fault}")
    return played


def learnt(
    before: Calibration, played: Played, windows: Windows, present: Installed
) -> Calibration:
    """A calibration with what a run that worked showed: sizes, and what is installed.

    Args:
        before: The calibration it was played with.
        played: The run.
        windows: Finds the game's window.
        present: What is installed.
    """
    area = _window(windows)
    world = played.log.world
    return replace(
        before,
        window=(area.width, area.height),
        screen=None if world is None else world.screen,
        installed=dict(present.as_facts()),
    )


def _tried(terrain: tuple[TerrainBox, ...]) -> tuple[Machine, Scenario]:
    """A machine of two blocks on the ground, in the level that is open."""
    machine = Machine()
    machine.act("start", {})
    machine.act(
        "attach_block_to",
        {"base_block": "1", "face": "A", "new_block": "Small Wooden Block", "note": ""},
    )
    boxes = [box.model_dump() for box in terrain]
    return machine, Scenario.model_validate(
        {"duration_s": TRIAL_S, "control": {"mode": "agent"}, "terrain": boxes}
    )


def _pointed(
    screen_input: ScreenInput, windows: Windows, ask: Ask, tell: Tell, *, what: str, now: str
) -> tuple[int, int] | None:
    """Where the mouse was pointed, pixels of the screen; None to keep what there is."""
    while True:
        answer = ask(
            f"Point the mouse at {what}, and press Enter here ({KEEP} and Enter keeps {now}): "
        )
        if answer.strip().casefold() == KEEP:
            return None
        point = screen_input.position()
        if _inside(point, _window(windows)):
            return point
        tell(OUTSIDE)


def _window(windows: Windows) -> Area:
    window = windows.find()
    if window is None:
        raise NotSetUpError(
            f"there is no {windows.wanted}: start the game, or correct BUILDARENA_BESIEGE_TITLE "
            "and BUILDARENA_BESIEGE_EXECUTABLE"
        )
    return window


def _inside(point: tuple[int, int], window: Area) -> bool:
    x, y = point[0] - window.left, point[1] - window.top
    return 0 <= x <= window.width and 0 <= y <= window.height


def _fractions(point: tuple[int, int], window: Area) -> tuple[float, float]:
    x, y = (point[0] - window.left) / window.width, (point[1] - window.top) / window.height
    return (round(x, 4), round(y, 4))
