"""Walks a person through calibration, and tries the result with a small machine."""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

from buildarena_benchmark import builtin_tasks
from buildarena_besiege import GameRun, prepare_run
from buildarena_geometry import Machine
from buildarena_simulation import Scenario
from buildarena_simulation.scenario import TerrainBox
from buildarena_simworker.besiege.errors import DesktopError
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
from buildarena_simworker.besiege.screen.window import WindowDesktop
from buildarena_simworker.besiege.screen.windows import Area, Windows, find_window
from buildarena_simworker.besiege.settings import BesiegeSettings, TimeLimits

BEFORE: Final = {
    "name_box": "Open the list of machine files in the game.",
    "set_ground": "Close the list of machine files.",
    "confirm": "Click the button that deletes the machine, so that the game asks for confirmation.",
}
"""Actions in the game that make some positions visible."""
TRIAL_S: Final = 2.0
KEEP: Final = "k"
DONE: Final = "d"
LOG: Final = "log_window"
OUTSIDE: Final = "The mouse is not over the game's window."


@dataclass(frozen=True, slots=True, kw_only=True)
class Asker:
    """Asks a person to point with the mouse.

    Attributes:
        screen_input: Source of the mouse's position.
        windows: Finder of the game's window.
        ask: Function that shows a question and returns the answer.
        show: Function that shows a line.
    """

    screen_input: ScreenInput
    windows: Windows
    ask: Callable[[str], str]
    show: Callable[[str], None]

    def positions(self, before: Calibration) -> Calibration:
        """Ask for each position; keep those of before unless an answer changes them.

        Raises:
            NotSetUpError: The window is missing.
        """
        places = dict(before.positions)
        for name, (_, description) in POSITIONS.items():
            if name in BEFORE:
                self.show(BEFORE[name])
            x, y = places[name]
            point = self._pointed(description, now=f"{x:.3f}, {y:.3f}")
            if point is not None:
                places[name] = _fractions(point, find_window(self.windows))
        window = find_window(self.windows)
        return replace(before, positions=places, window=(window.width, window.height), screen=None)

    def log(self, before: Calibration) -> Calibration:
        """Ask for the position of the mod's log, which is drawn only after a machine printed."""
        x, y = before.pixels[LOG]
        self.show("A machine runs and prints. If no log is shown, press Ctrl+L in the game.")
        point = self._pointed(PIXELS[LOG][1], now=f"{x}, {y}")
        if point is None:
            return before
        window = find_window(self.windows)
        place = (point[0] - window.left, point[1] - window.top)
        return replace(before, pixels={**before.pixels, LOG: place})

    def path(self, before: Calibration) -> Calibration:
        """Record the clicks from the game's title to its level, and the waits between."""
        self.show("Start the game, and wait until its title is shown.")
        clicks: list[PathClick] = []
        last = time.monotonic()
        while True:
            answer = self.ask(
                f"Point the mouse at what is clicked as number {len(clicks) + 1}, press Enter "
                f"here, and click it then ({DONE} and Enter once the level is open): "
            )
            if answer.strip().casefold() == DONE:
                break
            window, point = find_window(self.windows), self.screen_input.position()
            if not _inside(point, window):
                self.show(OUTSIDE)
                continue
            now = time.monotonic()
            x, y = _fractions(point, window)
            clicks.append(PathClick(x=x, y=y, wait_s=round(min(now - last, MAX_WAIT_S), 1)))
            last = now
        return replace(before, path=tuple(clicks))

    def _pointed(self, subject: str, *, now: str) -> tuple[int, int] | None:
        """Return the mouse's position, pixels of the screen; None to keep the present value."""
        while True:
            answer = self.ask(
                f"Point the mouse at {subject}, and press Enter here "
                f"({KEEP} and Enter keeps {now}): "
            )
            if answer.strip().casefold() == KEEP:
                return None
            point = self.screen_input.position()
            if _inside(point, find_window(self.windows)):
                return point
            self.show(OUTSIDE)


def opened_terrain(settings: BesiegeSettings) -> tuple[TerrainBox, ...]:
    """Return the terrain of the level that the owner declared open; empty if the game opens it."""
    task = None if settings.opens_levels else builtin_tasks().get(settings.level)
    return () if task is None else task.scenario.terrain


def printing_run(terrain: tuple[TerrainBox, ...] = ()) -> GameRun:
    """Return a machine whose log a person can point at: it repeats its end line forever.

    Args:
        terrain: Terrain of the open level.
    """
    machine, scenario = _make_trial(terrain)
    return prepare_run(machine, scenario, name="baprint", run_id=f"print{uuid.uuid4().hex[:8]}")


def try_out(
    desktop: WindowDesktop,
    limits: TimeLimits,
    show: Callable[[str], None],
    terrain: tuple[TerrainBox, ...] = (),
) -> Played | None:
    """Play a machine of two blocks for two seconds, from loading to deleting.

    Args:
        desktop: Game, driven by the positions to test.
        limits: Time limits.
        show: Function that shows a line for each success or failure.
        terrain: Terrain of the open level.

    Returns:
        The run; None after a failure.
    """
    machine, scenario = _make_trial(terrain)
    try:
        played = play(
            desktop,
            machine,
            scenario,
            name="batry",
            prefix="try",
            require_held=lambda: None,
            limits=limits,
        )
    except (RunFailedError, DesktopError) as error:
        show(f"It does not work yet: {error}")
        return None
    show(f"Loaded, started, read ({TRIAL_S:.0f} s at {played.pace:.2f} of real time), deleted.")
    for fault in played.faults:
        show(f"It needed another try: {fault}")
    return played


def record_findings(
    before: Calibration, played: Played, windows: Windows, present: Installed
) -> Calibration:
    """Return a calibration with the findings of a successful run: sizes, and installed versions.

    Args:
        before: Calibration that the run used.
        windows: Finder of the game's window.
        present: Installed versions.
    """
    area = find_window(windows)
    world = played.log.world
    return replace(
        before,
        window=(area.width, area.height),
        screen=None if world is None else world.screen,
        installed=dict(present.as_facts()),
    )


def _make_trial(terrain: tuple[TerrainBox, ...]) -> tuple[Machine, Scenario]:
    """Return a machine of two blocks on the ground, in the open level."""
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


def _inside(point: tuple[int, int], window: Area) -> bool:
    x, y = point[0] - window.left, point[1] - window.top
    return 0 <= x <= window.width and 0 <= y <= window.height


def _fractions(point: tuple[int, int], window: Area) -> tuple[float, float]:
    x, y = (point[0] - window.left) / window.width, (point[1] - window.top) / window.height
    return (round(x, 4), round(y, 4))
