"""What the runner asks of a game, however it is driven."""

from __future__ import annotations

from typing import Protocol

from buildarena_besiege import GameRun
from buildarena_geometry import Machine
from buildarena_simulation import Scenario, Trajectory


class RunLog(Protocol):
    """What a game said of one run; `buildarena_besiege.GameLog` is one."""

    @property
    def begun(self) -> bool:
        """Whether the run's first line was seen."""

    @property
    def ended(self) -> bool:
        """Whether its last line was seen."""

    @property
    def time_s(self) -> float:
        """The game's own time in the newest line, seconds."""

    @property
    def complaints(self) -> tuple[str, ...]:
        """Lines that speak of an error of the script."""

    def read(self, text: str) -> None:
        """Takes in what the game showed."""

    def text(self) -> str:
        """Every line that counts: what is kept."""


class Desktop(Protocol):
    """Controls one running game.

    Each call returns when its effect was seen, and raises `DesktopError` when it was not.
    """

    @property
    def puts_down(self) -> bool:
        """Whether it can put a machine onto the ground; otherwise its file must."""

    def require_able(self, run: GameRun) -> None:
        """Checks that this way of driving the game can do what the run needs.

        Raises:
            PermanentError: It never can.
            LevelClosedError: The run's level is not open and cannot be opened.
        """

    def prepare(self, run: GameRun) -> None:
        """Brings a game to the front that has the run's level open, and no machine in it."""

    def load(self, run: GameRun) -> None:
        """Loads the run's machine file and puts the machine where it starts."""

    def start(self, run: GameRun) -> None:
        """Starts the simulation; the log window, if there is one, shows the run's lines."""

    def new_log(self, run: GameRun) -> RunLog:
        """What the run's lines are gathered in."""

    def trajectory(self, log: RunLog, machine: Machine, scenario: Scenario) -> Trajectory:
        """What the log tells of the run.

        Raises:
            LogIncompleteError: Something that a score needs is missing.
        """

    def read_log(self) -> str:
        """What the log shows now, or has shown since it was read last."""

    def stop(self) -> None:
        """Stops the simulation."""

    def clear(self) -> None:
        """Takes the machine out of the game."""

    def recover(self) -> None:
        """Takes away what may be in the way: dialogs, held keys, a lost focus."""

    def is_alive(self) -> bool:
        """Whether the game still runs."""

    def restart(self) -> None:
        """Ends the game, however it is, and starts it again.

        Raises:
            GameGoneError: The runner cannot start it.
        """

    def screenshot(self) -> bytes | None:
        """A picture of the screen (PNG); None where there is no screen."""

    def close(self) -> None:
        """Lets every key go, and ends a game that this runner started."""
