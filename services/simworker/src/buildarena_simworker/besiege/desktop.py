"""What the runner asks of a game."""

from __future__ import annotations

from typing import Protocol

from buildarena_besiege import GameLog, GameRun
from buildarena_geometry import Machine
from buildarena_simulation import Scenario, Trajectory


class Desktop(Protocol):
    """Controls one running game.

    Each call returns when its effect was seen, and raises `DesktopError` when it was not.
    """

    def require_able(self, run: GameRun) -> None:
        """Checks that this way of driving the game can do what the run needs.

        Raises:
            PermanentError: It never can.
            LevelClosedError: The run's level is not open and cannot be opened.
        """

    def prepare(self, run: GameRun) -> None:
        """Brings a game to the front, with the run's level open and without a machine."""

    def load(self, run: GameRun) -> None:
        """Loads the run's machine file and puts the machine where it starts."""

    def start(self, run: GameRun) -> None:
        """Starts the simulation; the log window shows the run's lines."""

    def new_log(self, run: GameRun) -> GameLog:
        """An empty log that collects the run's lines."""

    def require_level(self, run: GameRun, log: GameLog) -> None:
        """Checks what the run reports of its level, as soon as it does.

        Raises:
            WrongLevelError: Another level than the run's is open.
            ScreenError: The game draws to another size than when it was calibrated.
        """

    def trajectory(self, log: GameLog, machine: Machine, scenario: Scenario) -> Trajectory:
        """The run's trajectory from its log.

        Raises:
            LogIncompleteError: Something that a score needs is missing.
        """

    def read_log(self) -> str:
        """What the log shows, or what came since it was read last."""

    def stop(self) -> None:
        """Stops the simulation."""

    def clear(self) -> None:
        """Removes the machine from the game."""

    def recover(self) -> None:
        """Clears what may block a step: dialogs, held keys, a lost focus."""

    def is_alive(self) -> bool:
        """Whether the game still runs."""

    def restart(self) -> None:
        """Ends the game, whatever its state, and starts it again.

        Raises:
            GameGoneError: The runner cannot start it.
        """

    def screenshot(self) -> bytes | None:
        """A picture of the screen (PNG); None where there is none."""

    def close(self) -> None:
        """Releases every key, and ends a game that this runner started."""
