"""The game behind the window: what is loaded, what runs, what the log says."""

import random
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from support.game.stand_in_game.faults import Fault, Faults
from support.game.stand_in_game.golden import UPDATES_PER_S, GameFileError, Run, read_run
from support.game.stand_in_game.levels import Level
from support.game.stand_in_game.log_window import LogWindow

GRAVITY: Final = -32.81
_LONGEST_FRAME_S: Final = 0.25
"""A frame that took longer than this makes the game lag instead of jump."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """How the game runs.

    Attributes:
        games: where the golden logs are.
        speed: game time over the wall clock.
        load_s: how long a machine takes to load, game time.
        log_file: where the log is written as well.
        level: the level file that is open; None for the flat sandbox.
        screen: what the game says of its window's size, pixels.
    """

    games: Path
    speed: float = 1.0
    load_s: float = 0.3
    log_file: Path | None = None
    level: str | None = None
    screen: tuple[int, int] = (1280, 800)


class Game:
    """The state of the game; the window moves it."""

    def __init__(self, settings: Settings, faults: Faults) -> None:
        self.settings, self.faults = settings, faults
        self._draw = random.Random(0)
        self.log = LogWindow(settings.log_file)
        self.level = Level(settings.level)
        self.screen = settings.screen
        self.machine_name: str | None = None
        self.run: Run | None = None
        self.grounded = self.simulating = False
        self.message = ""
        self.counts = dict.fromkeys(("loads", "starts", "stops", "deletes", "copies"), 0)
        self._run_faults: list[Fault] = []
        self._clock_s, self._update, self._failed = 0.0, 0, False

    def load(self, path: Path) -> bool:
        """Loads a machine in place of the present one; whether that worked."""
        try:
            self.run = read_run(path, self.settings.games)
        except GameFileError as error:
            self.message = str(error)
            return False
        self.machine_name, self.message, self.grounded = path.stem, "", False
        self.counts["loads"] += 1
        return True

    def set_ground(self) -> None:
        """Puts the machine on the floor."""
        self.grounded = self.run is not None

    def delete(self) -> None:
        """Removes the machine."""
        if self.run is not None:
            self.counts["deletes"] += 1
        self.machine_name = self.run = None
        self.grounded = False

    def start(self) -> list[Fault]:
        """Starts the simulation, if there is a machine; the faults that strike then."""
        if self.run is None or self.simulating:
            return []
        self.simulating = True
        self.counts["starts"] += 1
        self._run_faults = self.faults.at("start")
        self._clock_s, self._update, self._failed = 0.0, -1, False
        self.log.clear()
        return self._run_faults

    def stop(self) -> None:
        """Ends the simulation; the machine is as it was built."""
        if self.simulating:
            self.counts["stops"] += 1
        self.simulating = False

    def frame(self, passed_s: float) -> None:
        """One frame of the game."""
        if not self.simulating or self.run is None:
            return
        self._clock_s += min(passed_s, _LONGEST_FRAME_S) * self.settings.speed * self._pace()
        printed: list[str] = []
        # All updates that are due come at once, as at a real game's frame.
        while self._update < int(self._clock_s * UPDATES_PER_S + 1e-6):
            self._update += 1
            if not self._failed:
                printed += self.run.printed(self._update, self._world())
            printed += self._errors()
        self.log.append(printed, self._run_faults)

    def _world(self) -> str:
        """What the script measures in its first update: gravity, entities, screen, ground."""
        assert self.run is not None
        heights = [self.level.ground(*place) for place in self.run.probes]
        size = (len(self.level.boxes), *self.screen)
        return ",".join(
            [f"w,{GRAVITY:.4f}", *map(str, size), *(f"{height:.4f}" for height in heights)]
        )

    @property
    def time_s(self) -> float:
        """Game time since the simulation's start, seconds."""
        return self._clock_s if self.simulating else 0.0

    def _errors(self) -> list[str]:
        """A script that fails says so and is called no more; the game goes on."""
        for fault in self._run_faults:
            if fault.kind == "lua_error" and self._update == fault.number("update", 200):
                self._failed = True
                return [f"Lua error: {fault.text('main.lua:1: attempt to index a nil value')}"]
        return []

    def _pace(self) -> float:
        pace = 1.0
        for fault in self._run_faults:
            if fault.kind == "lag":
                pace *= self._draw.uniform(0.0, 2.0 / fault.number("slowness", 3.0))
        return pace
