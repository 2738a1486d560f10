"""What all ways of playing the game have in common as a simulator."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from buildarena_pipeline.errors import PermanentError
from buildarena_pipeline.runtime.annotations import annotate
from buildarena_pipeline.runtime.simulators.simulator import BESIEGE, TrialRequest, TrialResult
from buildarena_simworker_besiege.settings import BesiegeSettings


class GameSimulator(ABC):
    """Runs trials in the game.

    Args:
        settings: Versions and folders.
        facts: What else a manifest should hold: how the game is driven.
    """

    name = BESIEGE
    repeatable = False

    def __init__(self, settings: BesiegeSettings, facts: Mapping[str, Any]) -> None:
        self._settings = settings
        self._facts = facts

    @property
    def versions(self) -> Mapping[str, Any]:
        """What can change a trajectory."""
        return {
            "engine": BESIEGE,
            "simulation": self._settings.version,
            "game": self._settings.game,
            "mod": self._settings.mod,
            **self._facts,
        }

    def run(self, trial: TrialRequest) -> TrialResult:
        """Plays the machine in the game; see `Simulator`."""
        played = self.play_trial(trial)
        annotations = annotate(trial.task, trial.machine, trial.controls)
        return replace(played, annotations=annotations)

    def play_trial(self, trial: TrialRequest) -> TrialResult:
        """As `run`, without what our engines say of it."""
        if trial.version != self._settings.version:
            raise PermanentError(
                f"the job was submitted for {BESIEGE}-{trial.version}, and this worker plays "
                f"{BESIEGE}-{self._settings.version}: submit it again",
                reason="game_version",
            )
        return self._play(trial)

    @abstractmethod
    def _play(self, trial: TrialRequest) -> TrialResult:
        """Plays the machine; errors as for `run`."""

    @abstractmethod
    def close(self) -> None:
        """Leaves no key held and no game that was started here."""
