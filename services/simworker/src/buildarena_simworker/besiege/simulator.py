"""The game as a simulator of the simulate stage."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from buildarena_backend.errors import PermanentError, StartupError
from buildarena_backend.settings import Settings
from buildarena_backend.trials.annotations import annotate
from buildarena_backend.trials.installed_simulators import InstalledSimulator
from buildarena_backend.trials.simulator import BESIEGE, MachineRefusedError, SimulatorFaultError
from buildarena_backend.trials.trials import File, TrialRequest, TrialResult, refused
from buildarena_besiege import MachineNotPlayableError
from buildarena_simulation import MachineNotSimulable
from buildarena_simworker.besiege.errors import NeedsPersonError, NotSetUpError
from buildarena_simworker.besiege.play import LAGGING, Played, RunFailedError, play
from buildarena_simworker.besiege.screen.window import WindowDesktop, make_desktop
from buildarena_simworker.besiege.settings import BesiegeSettings

PERSON_WAIT_S: Final = 60.0
"""Delay of a job that needs a person, for example to open a level, seconds."""
FAULT_WAIT_S: Final = 5.0
"""Delay of a job after a fault of the game, seconds."""


class BesiegeSimulator:
    """Simulator that runs trials in the game.

    Args:
        settings: Versions and folders.
        desktop: Controller of the game.
        facts: Further data for a manifest: calibration, screen.
    """

    name = BESIEGE

    def __init__(
        self, settings: BesiegeSettings, desktop: WindowDesktop, facts: Mapping[str, Any]
    ) -> None:
        self._settings = settings
        self._desktop = desktop
        self._facts = facts

    @property
    def versions(self) -> Mapping[str, Any]:
        """Versions that can change a trajectory."""
        return {
            "engine": BESIEGE,
            "simulation": self._settings.version,
            "game": self._settings.game,
            "mod": self._settings.mod,
            **self._facts,
        }

    def run(self, trial: TrialRequest) -> TrialResult:
        """Play the machine in the game; see `Simulator`."""
        if trial.version != self._settings.version:
            raise PermanentError(
                f"the job was submitted for {BESIEGE}-{trial.version}, and this worker plays "
                f"{BESIEGE}-{self._settings.version}: submit it again",
                reason="game_version",
            )
        played = self._played(trial)
        return TrialResult(
            trajectory=played.trajectory,
            versions={**self.versions, **_course(played), **refused(played.failure)},
            files=_files(played, trial.number),
            annotations=annotate(trial.task, trial.machine, trial.controls),
        )

    def _played(self, trial: TrialRequest) -> Played:
        try:
            return play(
                self._desktop,
                trial.machine,
                trial.task.scenario,
                name=_file_name(trial),
                prefix=f"{trial.token}a",
                controls=trial.controls,
                require_held=trial.require_held,
                limits=self._settings.time_limits,
            )
        except (MachineNotPlayableError, MachineNotSimulable) as error:
            raise MachineRefusedError(str(error)) from error
        except NeedsPersonError as error:
            raise SimulatorFaultError(str(error), delay_s=PERSON_WAIT_S, endless=True) from error
        except RunFailedError as error:
            raise _fault(error, trial) from error
        except NotSetUpError as error:
            raise SimulatorFaultError(str(error), delay_s=FAULT_WAIT_S) from error

    def close(self) -> None:
        """Release all keys, and end a game that was started here."""
        self._desktop.close()


def describe(name: str) -> InstalledSimulator:
    """Describe the game, without loading a screen."""
    return InstalledSimulator(
        name=name,
        kind="game",
        make=besiege_simulator,
        version=lambda settings: settings.besiege_version,
        examine=_examine,
        single=True,
        deterministic=False,
    )


def besiege_simulator(settings: Settings) -> BesiegeSimulator:
    """Return the game of this machine.

    Raises:
        StartupError: The machine is not set up for it; the message has the remedy.
    """
    own = BesiegeSettings()
    if settings.besiege_version is None or own.version is None:
        raise StartupError(
            "BUILDARENA_BESIEGE_GAME and BUILDARENA_BESIEGE_MOD are not set: the versions of "
            "Besiege and of its Lua Scripting Mod, as the service names them"
        )
    try:
        desktop, facts = make_desktop(own)
    except NotSetUpError as error:
        raise StartupError(str(error)) from error
    return BesiegeSimulator(own, desktop, facts)


def _examine(settings: Settings) -> tuple[str, str]:
    version = settings.besiege_version
    if version is None:
        advice = "see `python -m buildarena_simworker.besiege doctor`"
        return f"{BESIEGE} is not set up", advice
    return f"{BESIEGE} {version}", ""


def _fault(error: RunFailedError, trial: TrialRequest) -> SimulatorFaultError:
    """Return a run's failure with the screen's content."""
    files = {
        f"screenshot-{trial.number}-{trial.token}-{index}.png": File(
            data=shot, media_type="image/png"
        )
        for index, shot in enumerate(error.screenshots)
    }
    waits = error.waits_for_person
    delay_s = PERSON_WAIT_S if waits else FAULT_WAIT_S
    return SimulatorFaultError(str(error), files=files, delay_s=delay_s, endless=waits)


def _file_name(trial: TrialRequest) -> str:
    """Return a name that any keyboard types with single keys: letters and digits."""
    plain = "".join(filter(str.isalnum, trial.job_id.rpartition("_")[2].lower()))
    return f"ba{plain[:10]}n{trial.number}"


def _course(played: Played) -> dict[str, Any]:
    """Return a manifest's data on the run."""
    course: dict[str, Any] = {
        "pace": round(played.pace, 2),
        "lagged": played.pace < LAGGING,
        "run": played.run.run_id,
    }
    if played.faults:
        course["faults"] = list(played.faults)
    return course


def _files(played: Played, number: int) -> dict[str, File]:
    run = played.run
    return {
        f"machine-{number}.bsg": File(data=run.machine_file, media_type="application/xml"),
        f"script-{number}.lua": File(data=run.script.encode(), media_type="text/x-lua"),
        f"log-{number}.txt": File(data=played.log.text().encode(), media_type="text/plain"),
    }
