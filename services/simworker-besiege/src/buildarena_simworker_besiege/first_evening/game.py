"""The game of an evening, opened with the first step that needs it."""

from __future__ import annotations

from typing import cast

from buildarena_pipeline.runtime.simulators.simulator import TrialRequest, TrialResult
from buildarena_simworker_besiege.desktop import Desktop
from buildarena_simworker_besiege.first_evening.watching import WatchedDesktop
from buildarena_simworker_besiege.game_simulator import GameSimulator
from buildarena_simworker_besiege.screen.calibration import Calibration
from buildarena_simworker_besiege.set_up import make_desktop
from buildarena_simworker_besiege.settings import BesiegeSettings
from buildarena_simworker_besiege.simulator import BesiegeSimulator
from buildarena_simworker_besiege.toolkit.simulator import ToolkitSimulator


class EveningsGame:
    """The game, driven as runners drive it.

    Args:
        settings: Versions, folders and the driver.
    """

    def __init__(self, settings: BesiegeSettings) -> None:
        self.settings = settings
        self._desktop: WatchedDesktop | None = None
        self._simulator: GameSimulator | None = None

    @property
    def driver(self) -> str:
        """How the game is driven: window, headless or toolkit."""
        return "toolkit" if self.settings.driver == "toolkit" else self.settings.desktop

    @property
    def is_open(self) -> bool:
        """Whether a step has opened the desktop."""
        return self._desktop is not None

    @property
    def watched(self) -> WatchedDesktop:
        """The desktop; the published positions are saved where nothing is calibrated.

        Raises:
            NotSetUpError: Something is missing; the message says what to do.
        """
        if self._desktop is None:
            file = self.settings.calibration_file
            if self.driver == "window" and not file.exists():
                Calibration().save(file)
            desktop, facts = make_desktop(self.settings)
            self._desktop = WatchedDesktop(desktop)
            self._simulator = BesiegeSimulator(self.settings, self.desktop, facts)
        return self._desktop

    @property
    def desktop(self) -> Desktop:
        """The same, as runners see it."""
        return cast("Desktop", self.watched)

    def play(self, trial: TrialRequest) -> TrialResult:
        """Plays a trial as a runner does; errors as for `Simulator.run`.

        Raises:
            NotSetUpError: Something is missing; the message says what to do.
        """
        if self.driver == "toolkit" and self._simulator is None:
            self._simulator = ToolkitSimulator(self.settings)
        elif self.driver != "toolkit":
            _ = self.watched
        assert self._simulator is not None  # noqa: S101 - one of both was opened
        return self._simulator.play_trial(trial)

    def close(self) -> None:
        """Leaves no key held and no game that was started here."""
        if self._simulator is not None:
            self._simulator.close()
