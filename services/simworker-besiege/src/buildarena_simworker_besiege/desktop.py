"""What the runner asks of a game, whether it has a window or not."""

from __future__ import annotations

from typing import Protocol

from buildarena_besiege import GameRun
from buildarena_geometry import Machine
from buildarena_simulation import Scenario, Trajectory


class RunLog(Protocol):
    """What a game printed about one run; `buildarena_besiege.GameLog` is one."""

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
        """Adds what the game showed."""

    def text(self) -> str:
        """Every line that counts, to be stored."""


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
        """Brings a game to the front, with the run's level open and without a machine."""

    def load(self, run: GameRun) -> None:
        """Loads the run's machine file and puts the machine where it starts."""

    def start(self, run: GameRun) -> None:
        """Starts the simulation; the log window, if there is one, shows the run's lines."""

    def new_log(self, run: GameRun) -> RunLog:
        """An empty log that collects the run's lines."""

    def require_level(self, run: GameRun, log: RunLog) -> None:
        """Checks what the run reports of its level, as soon as it does.

        Raises:
            WrongLevelError: Another level than the run's is open.
            ScreenError: The game draws to another size than when it was calibrated.
        """

    def trajectory(self, log: RunLog, machine: Machine, scenario: Scenario) -> Trajectory:
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
        """A picture of the screen (PNG); None where there is no screen."""

    def close(self) -> None:
        """Releases every key, and ends a game that this runner started."""
