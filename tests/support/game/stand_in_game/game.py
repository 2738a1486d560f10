"""The game behind the window: what is loaded, what runs, what the log says."""

from pathlib import Path
from typing import Final

from support.game.stand_in_game.faults import Fault, Faults
from support.game.stand_in_game.golden import UPDATES_PER_S, GameFileError, Run, read_run
from support.game.stand_in_game.levels import Level
from support.game.stand_in_game.log_window import LogWindow

GRAVITY: Final = -32.81
SIZE: Final = (1280, 800)
"""The window's width and height, pixels."""
LOAD_S: Final = 0.3
"""How long a machine takes to load, game time."""
_LONGEST_FRAME_S: Final = 0.25
"""A frame that took longer than this makes the game lag instead of jump."""


class Game:
    """The state of the game; the window moves it."""

    def __init__(self, games: Path, faults: Faults, speed: float, level: str) -> None:
        self._games, self.faults, self.speed = games, faults, speed
        self.log, self.level = LogWindow(), Level(level)
        self.machine_name: str | None = None
        self.run: Run | None = None
        self.grounded = self.simulating = False
        self.message = ""
        self.counts = dict.fromkeys(("loads", "starts", "stops", "deletes", "copies"), 0)
        self._loses_lines = False
        self.time_s, self._update = 0.0, 0

    def load(self, path: Path) -> bool:
        """Loads a machine in place of the present one; whether that worked."""
        try:
            self.run = read_run(path, self._games)
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
        """Starts the simulation; the faults that strike then."""
        self.simulating = True
        self.counts["starts"] += 1
        struck = self.faults.at("start")
        self._loses_lines = any(fault.kind == "lost_lines" for fault in struck)
        self.time_s, self._update = 0.0, -1
        self.log.clear()
        return struck

    def stop(self) -> None:
        """Ends the simulation; the machine is as it was built."""
        if self.simulating:
            self.counts["stops"] += 1
        self.simulating = False

    def frame(self, passed_s: float) -> None:
        """One frame of the game."""
        if not self.simulating or self.run is None:
            return
        self.time_s += min(passed_s, _LONGEST_FRAME_S) * self.speed
        printed: list[str] = []
        # All updates that are due come at once, as at a real game's frame.
        while self._update < int(self.time_s * UPDATES_PER_S + 1e-6):
            self._update += 1
            printed += self.run.printed(self._update, self._world())
        self.log.append(printed, loses=self._loses_lines)

    def _world(self) -> str:
        """What the script measures in its first update: gravity, entities, screen, ground."""
        assert self.run is not None
        heights = [self.level.ground(*place) for place in self.run.probes]
        size = (len(self.level.boxes), *SIZE)
        return ",".join(
            [f"w,{GRAVITY:.4f}", *map(str, size), *(f"{height:.4f}" for height in heights)]
        )
