"""Interface between the runner and a game."""

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
        """Check that this way of driving the game can do what the run requires.

        Raises:
            PermanentError: It never will.
            LevelClosedError: The run's level is not open and cannot be opened.
        """

    def prepare(self, run: GameRun) -> None:
        """Bring a game to the front, with the run's level open and without a machine."""

    def load(self, run: GameRun) -> None:
        """Load the run's machine file and put the machine at its start."""

    def start(self, run: GameRun) -> None:
        """Start the simulation; the log window shows the run's lines."""

    def new_log(self, run: GameRun) -> GameLog:
        """Return an empty log that collects the run's lines."""

    def require_level(self, run: GameRun, log: GameLog) -> None:
        """Check the run's report of its level, as soon as there is one.

        Raises:
            WrongLevelError: Another level than the run's is open.
            ScreenError: The game draws to another size than when it was calibrated.
        """

    def trajectory(self, log: GameLog, machine: Machine, scenario: Scenario) -> Trajectory:
        """Return the run's trajectory from its log.

        Raises:
            LogIncompleteError: Data required for a score is missing.
        """

    def read_log(self) -> str:
        """Return the log window's content, or the new part of a log since the last call."""

    def stop(self) -> None:
        """Stop the simulation."""

    def clear(self) -> None:
        """Remove the machine from the game."""

    def recover(self) -> None:
        """Clear anything that may block a step: dialogs, held keys, a lost focus."""

    def is_alive(self) -> bool:
        """Check if the game still runs."""

    def restart(self) -> None:
        """End the game, whatever its state, and start it again.

        Raises:
            GameGoneError: The runner cannot start it.
        """

    def screenshot(self) -> bytes | None:
        """Return a picture of the screen (PNG); None if there is none."""

    def close(self) -> None:
        """Release every key, and end a game that this runner started."""
