"""The game as a simulator of the simulate stage, driven by the toolkit's command line."""

from __future__ import annotations

import hashlib
import uuid
from dataclasses import dataclass
from typing import Any, Final

import structlog

from buildarena_besiege import (
    GameRun,
    LogIncompleteError,
    MachineNotPlayableError,
    prepare_run,
    read_telemetry,
    telemetry_log,
    telemetry_trajectory,
)
from buildarena_pipeline.errors import PermanentError
from buildarena_pipeline.runtime.simulators.simulator import (
    File,
    MachineRefusedError,
    SimulatorFaultError,
    TrialRequest,
    TrialResult,
)
from buildarena_simulation import MachineNotSimulable, Trajectory
from buildarena_simulation.constants import SAMPLE_RATE_HZ
from buildarena_simworker_besiege.errors import DesktopError
from buildarena_simworker_besiege.game_simulator import GameSimulator
from buildarena_simworker_besiege.placing import require_placed
from buildarena_simworker_besiege.settings import BesiegeSettings
from buildarena_simworker_besiege.toolkit.command_line import (
    FOLDER,
    ToolkitCommand,
    new_folder,
    require_toolkit,
    toolkit_settings,
)
from buildarena_simworker_besiege.toolkit.run_folder import (
    Asked,
    RunFolder,
    folders_with_summary,
    read_run,
)

ATTEMPTS: Final = 3
SANDBOX: Final = "BARREN EXPANSE"
"""The toolkit's flat sandbox."""
SLOWEST: Final = 10.0
"""A run may take so many times its own duration by the wall clock."""
FAULT_WAIT_S: Final = 5.0

log = structlog.get_logger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Played:
    """A run that came to a trustworthy end."""

    run: GameRun
    timeline: bytes
    folder: RunFolder
    log: str
    trajectory: Trajectory
    elapsed_s: float
    unknown: tuple[str, ...]


class ToolkitSimulator(GameSimulator):
    """Runs trials in the game by the toolkit's command line.

    Args:
        settings: The command, versions and folders.

    Raises:
        NotSetUpError: The command cannot be run.
    """

    def __init__(self, settings: BesiegeSettings) -> None:
        require_toolkit(settings)
        own = toolkit_settings(settings)
        command = hashlib.sha256(own.command.encode()).hexdigest()[:12]
        super().__init__(own, {"driver": "toolkit", "command": command})
        self._command = ToolkitCommand(self._settings)
        self._command.end()

    def _play(self, trial: TrialRequest) -> TrialResult:
        faults: list[str] = []
        for _ in range(ATTEMPTS):
            try:
                played = self._attempt(trial)
            except (MachineNotPlayableError, MachineNotSimulable) as error:
                raise MachineRefusedError(str(error)) from error
            except (DesktopError, LogIncompleteError, OSError) as error:
                log.warning("toolkit_run_failed", error=str(error))
                faults.append(str(error))
                continue
            return self._result(trial, played, faults)
        name = f"output-{trial.number}-{trial.token}.txt"
        files = {name: File(data=self._command.output(), media_type="text/plain")}
        message = "; ".join(dict.fromkeys(faults))
        raise SimulatorFaultError(message, files=files, delay_s=FAULT_WAIT_S)

    def close(self) -> None:
        """Leaves nothing running that was started here."""
        self._command.end()

    def _attempt(self, trial: TrialRequest) -> _Played:
        run_id = f"ba{uuid.uuid4().hex}"
        machine, scenario = trial.machine, trial.task.scenario
        run = prepare_run(
            machine,
            scenario,
            name=run_id,
            run_id=run_id,
            controls=trial.controls,
            on_ground=True,
        )
        _require_able(run, self._settings)
        timeline = run.timeline(machine)
        folder = new_folder(self._settings.state, run_id)
        asked = Asked(
            machine=folder / f"{run_id}.bsg",
            controller=folder / f"{run_id}.json",
            sandbox=SANDBOX if run.level is None else str(self._command.level_file(run.level)),
            telemetry_hz=SAMPLE_RATE_HZ,
        )
        asked.machine.write_bytes(run.machine_file)
        asked.controller.write_bytes(timeline)
        root = folder / "run" if self._settings.runs is None else self._settings.runs
        before = folders_with_summary(root)
        elapsed_s = self._command.run(
            {
                "{bsg}": str(asked.machine),
                "{controller}": str(asked.controller),
                "{sandbox}": asked.sandbox,
                "{hz}": str(asked.telemetry_hz),
                "{duration}": f"{run.duration_s:g}",
                FOLDER: str(folder / "run"),
            },
            run.level,
            limit_s=self._settings.time_limits.start_s + SLOWEST * run.duration_s,
            require_held=trial.require_held,
        )
        done = read_run(root, before, asked)
        text = telemetry_log(done.telemetry, run.block_ids)
        game, mod = self._settings.game, self._settings.mod
        trajectory = telemetry_trajectory(text, machine, scenario, game=game, mod=mod)
        return _Played(
            run=run,
            timeline=timeline,
            folder=done,
            log=text,
            trajectory=require_placed(trajectory, machine, run),
            elapsed_s=elapsed_s,
            unknown=read_telemetry(done.telemetry, start="").unknown,
        )

    def _result(self, trial: TrialRequest, played: _Played, faults: list[str]) -> TrialResult:
        course: dict[str, Any] = {
            "run": played.run.run_id,
            "elapsed_s": round(played.elapsed_s, 1),
            "unknown_columns": list(played.unknown),
        }
        if faults:
            course["faults"] = faults
        number, folder = trial.number, played.folder
        return TrialResult(
            trajectory=played.trajectory,
            versions={**self.versions, **course},
            files={
                f"machine-{number}.bsg": _file(played.run.machine_file, "application/xml"),
                f"timeline-{number}.json": _file(played.timeline, "application/json"),
                f"summary-{number}.json": _file(folder.summary, "application/json"),
                f"input-manifest-{number}.json": _file(folder.manifest, "application/json"),
                f"log-{number}.txt": _file(played.log.encode(), "text/plain"),
            },
        )


def _require_able(run: GameRun, settings: BesiegeSettings) -> None:
    """Refuses runs that the command cannot play, or of which the telemetry tells too little.

    Raises:
        PermanentError: It never can.
    """
    if run.needs_script:
        raise PermanentError(
            "the toolkit's telemetry tells poses only: it does not make a cargo heavier, tell "
            "whether a cannon burns or ask a program, which this trial needs; run it in a game "
            "with a window",
            reason="needs_script",
        )
    if run.level is not None and not settings.opens_levels:
        raise PermanentError(
            "the toolkit's command opens no levels, which this task needs: name {level} in "
            "BUILDARENA_BESIEGE_COMMAND",
            reason="needs_level",
        )


def _file(data: bytes, media_type: str) -> File:
    return File(data=data, media_type=media_type)
